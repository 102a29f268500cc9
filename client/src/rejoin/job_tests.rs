//! Tests of whole jobs at a port that vanishes, falls silent and comes back, on a computer that
//! sleeps.

use super::{Clock, Rejoining, Wire};
use crate::error::Error;
use crate::fake::{FakePlotter, Fault};
use crate::link::{Answer, Link};
use crate::progress::Quiet;
use crate::sender::{Sender, Timeouts};
use penup_job::protocol::ABORT;
use penup_readers::lines::JobLine;
use proptest::prelude::*;
use std::collections::VecDeque;
use std::io::{self, Read as _};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const HOUR: Duration = Duration::from_secs(3600);

/// The longest time for which a plotter that is gone is waited for.
const LIMIT: Duration = Duration::from_secs(300);

/// What happens outside the client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Event {
    /// The computer sleeps for an hour between two calls.
    SleepsBetweenCalls,
    /// It sleeps for an hour while it waits for bytes.
    SleepsInWait,
    /// What the plotter says comes only after so many seconds.
    Late(u8),
    /// What the plotter has said and not delivered is lost.
    LosesAnswers,
    /// What the client sends next is lost.
    LosesLine,
    /// The last line that was answered is answered once more.
    AnswersTwice,
    /// The port is gone for so many seconds, and then has the same name.
    Unplugged(u8),
    /// It has another name then.
    Renamed(u8),
    /// The plotter's power fails.
    Restarts,
    /// Lines come that are none of the answers.
    Says(&'static str),
}

use Event::{
    AnswersTwice, Late, LosesAnswers, LosesLine, Renamed, Restarts, Says, SleepsBetweenCalls,
    SleepsInWait, Unplugged,
};

/// The plotter, its ports, and the time.
struct World {
    plotter: FakePlotter,
    now: Instant,
    /// The name of the port, and since when it is there.
    port: (u8, Instant),
    /// How often it has vanished: a port that was opened before is dead.
    vanished: u32,
    /// What is on its way to the client, and not before when.
    said: VecDeque<u8>,
    due: Instant,
    loses_line: bool,
    /// Whether the next wait takes an hour.
    sleeps: bool,
    /// The last answer to a line.
    answered: Vec<u8>,
    /// What happens at each of the next waits.
    events: VecDeque<Option<Event>>,
    /// How often the client has waited.
    waits: u32,
    /// Whether the machine was idle in its last report.
    is_idle: bool,
    /// Whether all was drawn when the plotter's power failed.
    was_whole: bool,
}

impl World {
    fn happens(&mut self, event: Event) {
        match event {
            SleepsBetweenCalls => self.now += HOUR,
            SleepsInWait => self.sleeps = true,
            Late(seconds) => self.due = self.now + Duration::from_secs(seconds.into()),
            LosesAnswers => self.drain_plotter(true),
            LosesLine => self.loses_line = true,
            AnswersTwice => self.said.extend(self.answered.clone()),
            Unplugged(seconds) => self.vanish(self.port.0, seconds),
            Renamed(seconds) => self.vanish(1 - self.port.0, seconds),
            Restarts => {
                self.was_whole |= self.is_idle && self.plotter.lines == whole();
                let _ = self.plotter.send(&[ABORT]);
                self.plotter.lines.clear();
            }
            Says(text) => self.said.extend(text.as_bytes()),
        }
    }

    fn vanish(&mut self, name: u8, seconds: u8) {
        self.drain_plotter(true);
        self.vanished += 1;
        self.port = (name, self.now + Duration::from_secs(seconds.into()));
    }

    /// Takes what the plotter has said.
    fn drain_plotter(&mut self, is_lost: bool) {
        let mut buffer = [0; 256];
        while let Ok(count @ 1..) = self.plotter.receive(&mut buffer, Duration::ZERO) {
            self.said.extend(&buffer[..count]);
        }
        if is_lost {
            self.said.clear();
        }
    }

    /// The bytes for which a client waits so long.
    fn wait(&mut self, buffer: &mut [u8], timeout: Duration) -> usize {
        if std::mem::take(&mut self.sleeps) {
            self.now += HOUR;
        }
        if self.said.is_empty() {
            let mut heard = [0; 256];
            let count = self.plotter.receive(&mut heard, timeout).unwrap_or(0);
            self.said.extend(&heard[..count]);
            let text = String::from_utf8_lossy(&heard[..count]).into_owned();
            if let Some(report) = text.lines().rfind(|line| line.starts_with('<')) {
                self.is_idle = report.starts_with("<Idle");
            }
            if let Some(answer) = text.lines().find(|line| line.starts_with("ok N")) {
                self.answered = format!("{answer}\r\n").into_bytes();
            }
        }
        if self.said.is_empty() || self.now < self.due {
            self.now += timeout;
            return 0;
        }
        self.now += Duration::from_micros(100);
        self.said.read(buffer).unwrap_or(0)
    }
}

/// The world as its inhabitants see it.
#[derive(Clone)]
struct Shared(Arc<Mutex<World>>);

impl Shared {
    fn lock(&self) -> MutexGuard<'_, World> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens the port with this name.
    fn open(&self, name: u8) -> Option<Port> {
        let mut world = self.lock();
        let is_there = world.port.0 == name && world.now >= world.port.1;
        if is_there && world.vanished > 0 {
            // A plotter at a USB port greets whoever opens the port.
            world.said.extend(b"\r\nGrbl 1.1h [penup 0.1.0 '$' for help]\r\n");
        }
        is_there.then(|| Port { world: self.clone(), opened: world.vanished, timeout: HOUR })
    }
}

impl Clock for Shared {
    fn now(&self) -> Instant {
        self.lock().now
    }

    fn sleep(&self, time: Duration) {
        self.lock().now += time;
    }
}

/// An open port of the plotter.
struct Port {
    world: Shared,
    opened: u32,
    timeout: Duration,
}

impl Port {
    fn fail_if_gone(&self) -> io::Result<()> {
        if self.world.lock().vanished == self.opened {
            Ok(())
        } else {
            Err(io::ErrorKind::BrokenPipe.into())
        }
    }
}

impl io::Write for Port {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.fail_if_gone()?;
        let mut world = self.world.lock();
        if bytes.ends_with(b"\n") && std::mem::take(&mut world.loses_line) {
            return Ok(bytes.len());
        }
        world.plotter.send(bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl io::Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.fail_if_gone()?;
        match self.world.lock().wait(buffer, self.timeout) {
            0 => Err(io::ErrorKind::TimedOut.into()),
            count => Ok(count),
        }
    }
}

impl Wire for Port {
    fn set_io_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        self.timeout = timeout;
        Ok(())
    }
}

/// The line of the client.
struct Rejoined {
    port: Rejoining<Port, Shared>,
    world: Shared,
}

impl Link for Rejoined {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.send(bytes, bytes.contains(&ABORT))
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut world = self.world.lock();
        if let Some(Some(event)) = world.events.pop_front() {
            world.happens(event);
        }
        world.waits += 1;
        assert!(world.waits < 100_000, "the client never gives up");
        drop(world);
        self.port.receive(buffer, timeout)
    }

    fn now(&self) -> Instant {
        self.port.now()
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }
}

/// The lines of the job.
fn lines() -> Vec<String> {
    (0..12).map(|number| format!("v {number} 1 2")).collect()
}

/// A plotter at an open port, and its world.
fn opened() -> (Rejoining<Port, Shared>, Shared) {
    let now = Instant::now();
    let world = Shared(Arc::new(Mutex::new(World {
        plotter: FakePlotter::new(Fault::None),
        now,
        port: (0, now),
        vanished: 0,
        said: VecDeque::new(),
        due: now,
        loses_line: false,
        sleeps: false,
        answered: Vec::new(),
        events: VecDeque::new(),
        waits: 0,
        is_idle: false,
        was_whole: false,
    })));
    world.lock().plotter.strokes = 20;
    let [same, other] = [0, 1].map(|name| {
        let world = world.clone();
        Box::new(move || world.open(name)) as super::Open<Port>
    });
    let wire = world.open(0).expect("a port");
    let mut port = Rejoining::with_clock(wire, same, world.clone());
    port.also_open(other);
    port.wait(LIMIT, true);
    (port, world)
}

/// Draws a job while events happen, each at its wait of the client behind the beginning of the
/// conversation. Returns the outcome, and the lines that the plotter has taken, or had when it was
/// done and its power failed.
fn draw(events: impl IntoIterator<Item = Option<Event>>) -> (Result<(), Error>, Vec<String>) {
    let (port, world) = opened();
    let mut link = Rejoined { port, world: world.clone() };
    let interrupt = AtomicBool::new(false);
    let mut sender = Sender::open(&mut link, Timeouts::default(), &interrupt).expect("a plotter");
    world.lock().events.extend(events);
    let mut job = vec![JobLine::command("$clear")];
    job.extend(lines().into_iter().map(JobLine::command));
    let drawn = sender.stream(&job, &mut Quiet).and_then(|()| sender.plot(&mut Quiet));
    if drawn.is_ok() {
        sender.end();
    }
    let mut world = world.lock();
    let taken = std::mem::take(&mut world.plotter.lines);
    (drawn, if world.was_whole { whole() } else { taken })
}

/// What a plotter takes of a whole job.
fn whole() -> Vec<String> {
    lines().into_iter().chain(["$plot".to_owned()]).collect()
}

/// Checks that a job is whole at which these events happen, wherever they do.
fn assert_whole(events: &[Event]) {
    for wait in 0..60 {
        let before = std::iter::repeat_n(None, wait);
        let (drawn, taken) = draw(before.chain(events.iter().copied().map(Some)));
        assert!(drawn.is_ok(), "{events:?} at wait {wait}: {drawn:?}");
        assert_eq!(taken, whole(), "{events:?} at wait {wait}");
    }
}

#[test]
fn a_computer_may_sleep_for_an_hour_between_two_calls() {
    assert_whole(&[SleepsBetweenCalls]);
    assert_whole(&[SleepsBetweenCalls, SleepsBetweenCalls]);
}

#[test]
fn a_computer_may_sleep_for_an_hour_while_it_waits() {
    assert_whole(&[SleepsInWait]);
    assert_whole(&[LosesAnswers, SleepsInWait]);
}

#[test]
fn the_port_may_be_gone_when_the_computer_wakes_up() {
    assert_whole(&[SleepsBetweenCalls, Unplugged(20)]);
    assert_whole(&[Unplugged(20), SleepsBetweenCalls]);
    assert_whole(&[SleepsInWait, Renamed(2)]);
}

#[test]
fn a_port_may_come_back_under_another_name() {
    assert_whole(&[Unplugged(30)]);
    assert_whole(&[Renamed(30)]);
    assert_whole(&[Renamed(1), Renamed(0)]);
}

#[test]
fn answers_may_come_late_or_twice_or_not_at_all() {
    for seconds in [1, 4, 20, 250] {
        assert_whole(&[Late(seconds)]);
    }
    assert_whole(&[LosesAnswers, LosesLine]);
    assert_whole(&[AnswersTwice]);
    assert_whole(&[Unplugged(2), AnswersTwice]);
    // The first report behind an opened port is late, too.
    assert_whole(&[Unplugged(2), Late(10)]);
}

#[test]
fn a_port_may_vanish_again_while_the_job_is_begun_again() {
    for between in 0..20 {
        for wait in 0..20 {
            let mut events = vec![None; wait];
            events.push(Some(Unplugged(0)));
            events.extend(vec![None; between]);
            events.push(Some(Unplugged(0)));
            let (drawn, taken) = draw(events);
            assert!(drawn.is_ok(), "at waits {wait} and {between} later: {drawn:?}");
            assert_eq!(taken, whole(), "at waits {wait} and {between} later");
        }
    }
}

#[test]
fn a_plotter_is_not_gone_because_it_was_not_asked() {
    let (mut port, world) = opened();
    let mut buffer = [0; 256];
    let wait = Duration::from_millis(100);
    port.send(b"?", false).expect("an open port");
    assert!(port.receive(&mut buffer, wait).expect("an open port") > 0);
    for _ in 0..100 {
        assert_eq!(port.receive(&mut buffer, wait).expect("an open port"), 0);
    }
    world.lock().happens(Late(1));
    port.send(b"?", false).expect("an open port");
    assert_eq!(port.receive(&mut buffer, wait).expect("an open port"), 0);
    assert!(port.gone.is_none());
}

#[test]
fn a_plotter_that_is_away_for_too_long_is_an_error() {
    for event in [Late(200), Unplugged(200)] {
        let (drawn, _) = draw(std::iter::repeat_n(Some(event), 40_000));
        assert!(matches!(drawn, Err(Error::Link(_))), "{event:?}: {drawn:?}");
    }
}

#[test]
fn a_plotter_that_has_started_again_is_an_error_unless_nothing_is_lost() {
    for with in [vec![Restarts], vec![Unplugged(5), Restarts], vec![Restarts, Unplugged(5)]] {
        for wait in 0..60 {
            let before = std::iter::repeat_n(None, wait);
            let (drawn, taken) = draw(before.chain(with.iter().copied().map(Some)));
            assert!(drawn.is_err() || taken == whole(), "{with:?} at wait {wait}: {taken:?}");
        }
    }
}

fn harmless() -> impl Strategy<Value = Event> {
    prop_oneof![
        Just(SleepsBetweenCalls),
        Just(SleepsInWait),
        (0u8..100).prop_map(Late),
        Just(LosesAnswers),
        Just(LosesLine),
        Just(AnswersTwice),
        (0u8..100).prop_map(Unplugged),
        (0u8..100).prop_map(Renamed),
        Just(Says("ok\r\n")),
        Just(Says("error:9\r\n")),
        Just(Says("[MSG:a note]\r\n")),
    ]
}

fn any_event() -> impl Strategy<Value = Event> {
    prop_oneof![
        6 => harmless(),
        1 => Just(Restarts),
        1 => Just(Says("Grbl 1.1h [penup 0.1.0 '$' for help]\r\n")),
        1 => Just(Says("ALARM:1\r\n")),
    ]
}

fn now_and_then(event: impl Strategy<Value = Event>) -> impl Strategy<Value = Vec<Option<Event>>> {
    proptest::collection::vec(proptest::option::weighted(0.15, event), 0..120)
}

proptest! {
    #[test]
    fn each_line_is_taken_once_whatever_harmless_happens(events in now_and_then(harmless())) {
        // A report that comes too late behind the greeting of an opened port cannot tell any more
        // that the plotter has not started again.
        let is_late = events.iter().flatten().any(|it| matches!(it, Late(2..)));
        let greets = events.iter().flatten().any(|it| matches!(it, Unplugged(_) | Renamed(_)));
        let (drawn, taken) = draw(events);
        match drawn {
            Err(Error::Restarted) if is_late && greets => {}
            drawn => {
                prop_assert!(drawn.is_ok(), "{:?}", drawn);
                prop_assert_eq!(taken, whole());
            }
        }
    }

    #[test]
    fn each_line_is_taken_once_or_the_client_says_what_is_wrong(
        events in now_and_then(any_event()),
    ) {
        let (drawn, taken) = draw(events);
        match drawn {
            Ok(()) => prop_assert_eq!(taken, whole()),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
