// Lets an abort clear a DMA channel's count of transfers, which rp2040js leaves as it was.
//
// Writing a 1 to CHAN_ABORT ends the channel's transfers and clears its counter (RP2040 datasheet,
// 2.5.5.3). So a program must read how much is left before it aborts.

/** Lets an abort clear the count of each of these `channels`. */
export function clearCountAtAbort(channels) {
  for (const channel of channels) {
    const abort = channel.abort.bind(channel);
    channel.abort = () => {
      abort();
      channel.transCount = 0;
    };
  }
}
