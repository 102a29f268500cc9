//! A plotter that receives any bytes at any time.

use penup::boards::host::{HostBoard, PORTS, QUEUE_LENGTH};
use penup::machine::{Contacts, EventRing, PulserState};
use penup::plotter::{Board, EMPTY_LOOKAHEAD, Memory, Plotter};

/// In the input, this byte begins an order to the bench; any other byte is sent to the plotter.
///
/// - followed by 0: this byte itself is sent;
/// - followed by 1 to 0xDF: that many milliseconds pass;
/// - followed by 0xE0 to 0xFE: the lower bits say which contacts are closed;
/// - followed by 0xFF: the bytes behind it arrive at the other port.
const ORDER: u8 = 0xFF;

/// The byte that aborts a job and clears the queues.
const CTRL_X: u8 = 0x18;

/// How long a line may keep the main loop busy, in turns of the loop. It is more than the longest
/// job of the corpus needs.
const TURNS: u32 = 2_000_000;

/// Lets a small plotter receive the input, and checks at its end that the machine comes to rest,
/// that it can be unlocked, and that it answers.
pub fn fuzz(input: &[u8]) {
    let mut memory = Box::new(Memory::<256, 1024, 8192, PORTS>::new());
    let mut blocks = EMPTY_LOOKAHEAD;
    let mut ring = EventRing::<QUEUE_LENGTH>::new();
    let pins = PulserState::new();
    let mut board = HostBoard::new(&mut ring, &pins);
    let memory = memory.lend(&mut blocks);
    let mut plotter = Plotter::new(memory, &pins);
    plotter.greet(&mut board);

    let mut port = 0;
    let mut rest = input.iter().copied();
    while let Some(byte) = rest.next() {
        match (byte, if byte == ORDER { rest.next() } else { None }) {
            (ORDER, None) => break,
            (ORDER, Some(milliseconds @ 1..=0xDF)) => {
                for _ in 0..milliseconds {
                    plotter.poll(&mut board);
                    board.wait();
                }
            }
            (ORDER, Some(bits @ 0xE0..=0xFE)) => board.set_contacts(contacts(bits)),
            (ORDER, Some(0xFF)) => port = 1 - port,
            (byte, _) => {
                board.receive_by(port, &[byte]);
                if byte == b'\n' {
                    plotter.poll(&mut board);
                }
            }
        }
    }

    // Read all that came, then end the job, whatever it is, and leave the alarm.
    run(&mut plotter, &mut board, "reads all lines", |_, board| board.has_read_all());
    board.set_contacts(Contacts::default());
    board.receive(b"\n$5=0\n");
    board.receive(&[CTRL_X]);
    run(&mut plotter, &mut board, "comes to rest", |plotter, board| {
        board.has_read_all() && plotter.machine().is_stopped()
    });
    board.take_sent();
    board.receive(b"\n?");
    run(&mut plotter, &mut board, "reads the query", |_, board| board.has_read_all());
    for _ in 0..3 {
        plotter.poll(&mut board);
    }
    let answer = board.take_sent();
    assert!(answer.contains(&b'<'), "no status: {}", String::from_utf8_lossy(&answer));
}

/// Runs the plotter until `is_done`.
fn run(
    plotter: &mut Plotter<'_>,
    board: &mut HostBoard<'_>,
    what: &str,
    is_done: impl Fn(&Plotter<'_>, &HostBoard<'_>) -> bool,
) {
    for turn in 0..TURNS {
        let is_busy = plotter.poll(board);
        if is_done(plotter, board) {
            return;
        }
        // A job that only draws takes long: give it up, as a user would.
        if turn == TURNS / 2 {
            board.receive(&[CTRL_X]);
        }
        if !is_busy {
            board.wait();
        }
    }
    panic!("the plotter never {what}");
}

/// The contacts that are closed, by the lower bits.
fn contacts(bits: u8) -> Contacts {
    Contacts { x: bits & 1 != 0, y: bits & 2 != 0, stop: bits & 4 != 0 }
}
