//! Jobs through the interrupt's own code: hold, resume, abort, alarm, sleep.

use penup::drawing::{LineType, PagePoint};
use penup::machine::{
    Alarm, Machine, MachineError, PulserState, Setting, Settings, State, Target, TargetList, Value,
};
use penup::motion::Block;
use penup_host_tests::pin_machine::{self, Change, Stamped};
use std::collections::BTreeSet;

fn point(x: i32, y: i32) -> PagePoint {
    PagePoint { x, y }
}

fn to(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: None }
}

fn ink(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: Some(LineType::Full) }
}

fn dotted(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: Some(LineType::Dotted) }
}

fn job() -> Vec<Target> {
    vec![
        to(400, 300),
        ink(1200, 300),
        ink(1200, 900),
        ink(1190, 910),
        ink(400, 300),
        to(50, 60),
        dotted(900, 333),
        ink(900, 333),
        ink(20, 1000),
        to(0, 0),
    ]
}

/// Moves made with the pen down, and where the pins ended.
fn drawn(trace: &[Stamped]) -> (BTreeSet<(PagePoint, PagePoint)>, PagePoint) {
    let (mut at, mut up_x, mut up_y, mut pen) = (point(0, 0), true, true, 0);
    let mut inked = BTreeSet::new();
    let mut index = 0;
    while let Some(stamped) = trace.get(index) {
        let mut next = at;
        match stamped.change {
            Change::UpX(up) => up_x = up,
            Change::UpY(up) => up_y = up,
            Change::Pen(height) => pen = height,
            Change::StepX(true) => {
                next.x += if up_x { 1 } else { -1 };
                // A diagonal move raises both pins in one interrupt.
                if let Some(Stamped { time, change: Change::StepY(true) }) = trace.get(index + 1)
                    && *time == stamped.time
                {
                    next.y += if up_y { 1 } else { -1 };
                    index += 1;
                }
            }
            Change::StepY(true) => next.y += if up_y { 1 } else { -1 },
            _ => {}
        }
        if pen >= 64 && next != at {
            inked.insert((at.min(next), at.max(next)));
        }
        at = next;
        index += 1;
    }
    (inked, at)
}

#[test]
fn a_job_is_drawn_and_the_pins_end_where_the_path_does() {
    let targets = job();
    let trace = pin_machine::run(
        Settings::default(),
        &mut TargetList::new(&targets),
        25_000,
        &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&job())).expect("valid");
            }
            assert_eq!(turn.machine.position(), turn.pins);
            turn.now == 0 || turn.machine.state() == State::Run || !turn.machine.stands()
        },
    );
    let (inked, end) = drawn(&trace);
    assert_eq!(end, point(0, 0));
    // 800 + 600 + 10 + 790 moves, the line from (900, 333) to (20, 1000), and about half the dots.
    assert!(inked.len() > 800 + 600 + 10 + 790 + 880);
    let last_pen = trace.iter().rev().find_map(|stamped| match stamped.change {
        Change::Pen(height) => Some(height),
        _ => None,
    });
    assert_eq!(last_pen, Some(0));
}

#[test]
fn hold_and_resume_leave_the_same_ink() {
    let targets = job();
    let mut undisturbed = None;
    for held_at in [0u64, 1, 40, 333, 700, 1500, 2222, 3000, 4400] {
        let mut stood = false;
        let trace = pin_machine::run(
            Settings::default(),
            &mut TargetList::new(&targets),
            25_000,
            &mut |turn| {
                if turn.now == 0 {
                    turn.machine.start(&mut TargetList::new(&job())).expect("valid");
                }
                if held_at > 0 && turn.now == held_at * 25_000 {
                    turn.machine.hold();
                }
                let standing = turn.machine.state() == State::Hold { standing: true };
                if standing && turn.machine.stands() {
                    assert_eq!(turn.machine.planned_position(), turn.pins);
                    stood = true;
                    turn.machine.resume();
                }
                turn.machine.state() != State::Idle || !turn.machine.stands()
            },
        );
        let drawn = drawn(&trace);
        assert!(held_at == 0 || stood, "held at {held_at} ms");
        assert_eq!(&drawn, undisturbed.get_or_insert(drawn.clone()));
    }
}

#[test]
fn abort_keeps_the_position_and_leaves_the_machine_ready() {
    let targets = job();
    for aborted_at in [1u64, 333, 1500, 2222] {
        pin_machine::run(
            Settings::default(),
            &mut TargetList::new(&targets),
            25_000,
            &mut |turn| {
                if turn.now == 0 {
                    turn.machine.start(&mut TargetList::new(&job())).expect("valid");
                }
                if turn.now == aborted_at * 25_000 {
                    turn.machine.abort();
                }
                assert_eq!(turn.machine.position(), turn.pins);
                let ready = turn.machine.state() == State::Idle && turn.machine.stands();
                if ready {
                    assert_eq!(turn.machine.planned_position(), turn.pins);
                    assert_ne!(turn.pins, point(0, 0));
                }
                !ready
            },
        );
    }
}

#[test]
fn an_emergency_stops_the_pins_at_once_and_the_position_is_theirs() {
    let targets = job();
    let mut at_stop = None;
    let trace =
        pin_machine::run(Settings::default(), &mut TargetList::new(&targets), 2_500, &mut |turn| {
            if turn.now == 0 {
                turn.machine.start(&mut TargetList::new(&job())).expect("valid");
            }
            if turn.now == 25_000_000 {
                turn.machine.alarm(Alarm::EmergencyStop);
                at_stop = Some(turn.pins);
            }
            if turn.now < 26_000_000 {
                return true;
            }
            assert_eq!(Some(turn.pins), at_stop);
            assert_eq!(turn.machine.state(), State::Alarm(Alarm::EmergencyStop));
            turn.machine.unlock().expect("the queue is empty");
            assert_eq!(turn.machine.planned_position(), turn.pins);
            assert_eq!(turn.machine.state(), State::Idle);
            false
        });
    let late = trace.iter().filter(|stamped| {
        stamped.time > 25_000_000
            && matches!(stamped.change, Change::StepX(true) | Change::StepY(true))
    });
    assert_eq!(late.count(), 0);
}

#[test]
fn what_leads_beyond_the_travel_is_refused_before_anything_moves() {
    let pins = PulserState::new();
    let mut blocks = [Block::EMPTY; 4];
    let mut machine = Machine::new(Settings::default(), &mut blocks, &pins, u32::MAX);
    // 420 mm of 80 steps.
    let targets = [to(33_600, 0), ink(33_601, 5), ink(0, 0)];
    assert_eq!(
        machine.start(&mut TargetList::new(&targets)),
        Err(MachineError::BeyondTravel { target: 1, x: 1, y: 0 })
    );
    assert_eq!(
        machine.jog(point(0, -7)),
        Err(MachineError::BeyondTravel { target: 0, x: 0, y: -7 })
    );
    assert_eq!(machine.state(), State::Idle);
    machine.set(Setting::SoftLimits, Value::ZERO).expect("idle");
    assert!(machine.start(&mut TargetList::new(&targets)).is_ok());
    assert_eq!(machine.state(), State::Run);
    assert!(machine.jog(point(0, 0)).is_err());
    assert!(machine.sleep().is_err());
    assert!(machine.check(true).is_err());
    assert!(machine.unlock().is_err());
}
