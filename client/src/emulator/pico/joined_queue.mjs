// Joins the two queues of a PIO state machine, which rp2040js leaves at 4 words each.
//
// The bit FJOIN_TX gives the places of the receiving queue to the sending one, which then has 8;
// FJOIN_RX does the opposite. A change of either bit empties both queues (RP2040 datasheet, 3.7,
// SM0_SHIFTCTRL).

const WORDS = 4;
const JOIN_TX = 1 << 30;
const JOIN_RX = 1 << 31;
const JOINS = JOIN_TX | JOIN_RX;

/** Lets the state machines of `pio` join their queues. Call it before their queues are followed. */
export function joinQueues(pio) {
  const Queue = pio.machines[0].txFIFO.constructor;
  const joined = pio.machines.map(({ shiftCtrl }) => shiftCtrl & JOINS);
  const write = pio.writeUint32.bind(pio);
  pio.writeUint32 = (offset, value) => {
    write(offset, value);
    pio.machines.forEach((machine, index) => {
      const joins = machine.shiftCtrl & JOINS;
      if (joins === joined[index]) return;
      joined[index] = joins;
      machine.txFIFO = new Queue(joins & JOIN_TX ? 2 * WORDS : joins & JOIN_RX ? 0 : WORDS);
      machine.rxFIFO = new Queue(joins & JOIN_RX ? 2 * WORDS : joins & JOIN_TX ? 0 : WORDS);
      machine.updateDMATx();
      machine.updateDMARx();
    });
  };
}
