//! Flash that returns garbage once, as in a brown-out, loses nothing of a drawing in parts.

use super::{cut_in_the_middle, finish};
use penup_host_tests::cut_jobs::assert_one_drawing;
use penup_host_tests::random::Random;

/// More reads than there ever are.
const MANY: usize = 1 << 40;

#[test]
fn garbage_from_the_flash_at_a_start_loses_nothing() {
    let (mut board, whole, begun) = cut_in_the_middle();
    assert!(begun.len() > 10 && begun.len() < whole.len());
    let mut start = |garbage_after: usize| {
        board.flash.garbage_after = Some(garbage_after);
        let mut found = (String::new(), String::new());
        board.on(|plotter| found = (plotter.heard(), plotter.say("$resume")));
        (found, board.flash.garbage_after)
    };
    let (found, left) = start(MANY);
    let (greeting, answer) = &found;
    assert!(greeting.contains("[MSG:a job stopped at stroke "), "{greeting}");
    assert!(greeting.contains("[MSG:the flash keeps a model of "), "{greeting}");
    assert!(answer.ends_with("error:164\n"), "{answer}");
    let count = MANY - left.expect("there are fewer reads");
    assert!(count > 50, "{count}");
    for number in 0..count {
        assert_eq!(start(number), (found.clone(), None), "garbage at read {number} of {count}");
    }
}

#[test]
fn garbage_from_the_flash_while_a_drawing_goes_on_loses_nothing() {
    let (mut board, whole, begun) = cut_in_the_middle();
    let flash = board.flash.clone();
    let mut finish_with = |garbage_after: usize| {
        board.flash = flash.clone();
        let rest = board.on(|plotter| {
            plotter.heard();
            plotter.board.flash().expect("flash").garbage_after = Some(garbage_after);
            let answer = plotter.say("$resume=origin");
            assert!(answer.ends_with("ok\n"), "{answer}");
            finish(plotter);
        });
        assert_one_drawing(&whole, &[begun.clone(), rest]);
        board.flash.garbage_after
    };
    let count = MANY - finish_with(MANY).expect("there are fewer reads");
    assert!(count > 50, "{count}");
    let mut random = Random::new(7);
    for _ in 0..15 {
        let number = random.below(count as u64) as usize;
        assert_eq!(finish_with(number), None, "garbage at read {number} of {count}");
    }
}

/// The flash of the model returns a garbled word, which its cache then keeps for a while.
#[test]
fn garbage_from_the_flash_of_the_model_at_a_start_loses_nothing() {
    let (mut board, whole, begun) = cut_in_the_middle();
    let mut start = |garbage: Option<[usize; 2]>| {
        board.model.garbage = garbage;
        let mut found = (String::new(), String::new());
        board.on(|plotter| found = (plotter.heard(), plotter.say("$resume")));
        (found, board.model.garbage)
    };
    let (found, _) = start(None);
    assert!(found.0.contains("[MSG:the flash keeps a model of "), "{found:?}");
    assert!(found.1.ends_with("error:164\n"), "{found:?}");
    // Each word of the record.
    for word in 0..64 {
        assert_eq!(start(Some([0, word])), (found.clone(), None), "garbage in word {word}");
    }
    board.model.garbage = Some([0, 0]);
    let rest = board.on(|plotter| {
        let answer = plotter.say("$resume=origin");
        assert!(answer.ends_with("ok\n"), "{answer}");
        finish(plotter);
    });
    assert_one_drawing(&whole, &[begun, rest]);
}
