// The handler of the clock is pre-empted just before it sets its next alarm: the time that it has
// looked at is over by then.

const TIMER = 0x40054;
const ALARM_0 = 0x10;

/** Before the timer's alarm 0 is set, so many nanoseconds pass as `takeDelay` says. */
export function delayAlarm(chip, takeDelay, pass) {
  const timer = chip.peripherals[TIMER];
  const write = timer.writeUint32.bind(timer);
  timer.writeUint32 = (offset, value) => {
    const nanos = offset === ALARM_0 ? takeDelay() : 0;
    if (nanos) pass(nanos);
    write(offset, value);
  };
}
