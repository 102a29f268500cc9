//! The step interrupt's work, and what it tells the main loop.

use super::ring::EventRing;
use crate::motion::{
    BrakeOrders, EventKind, EventQueue, QueueSize, Runner, StepBrake, StepEvent, StepLength,
};
use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use embedded_hal::digital::{OutputPin, PinState};

/// What the interrupt and the main loop share. Only loads and stores, so a Cortex-M0+ has it too.
///
/// The main loop alone writes the orders, and the counts of what it finds to be taken.
#[derive(Debug, Default)]
pub struct PulserState {
    x: AtomicU32,
    y: AtomicU32,
    slack_x: AtomicU32,
    slack_y: AtomicU32,
    lift: AtomicU32,
    ticks: AtomicU32,
    underruns: AtomicU32,
    drained: AtomicBool,
    halt: AtomicBool,
    pulse_ticks: AtomicU32,
    inverted: AtomicU8,
    lift_inverted: AtomicBool,
    queue_steps: AtomicU32,
    queue_full: AtomicU32,
    brake: BrakeOrders,
}

impl PulserState {
    /// Nothing counted, nothing ordered.
    pub const fn new() -> Self {
        Self {
            x: AtomicU32::new(0),
            y: AtomicU32::new(0),
            slack_x: AtomicU32::new(0),
            slack_y: AtomicU32::new(0),
            lift: AtomicU32::new(0),
            ticks: AtomicU32::new(0),
            underruns: AtomicU32::new(0),
            drained: AtomicBool::new(true),
            halt: AtomicBool::new(false),
            pulse_ticks: AtomicU32::new(50),
            inverted: AtomicU8::new(0),
            lift_inverted: AtomicBool::new(false),
            queue_steps: AtomicU32::new(QueueSize::ENDLESS.steps),
            queue_full: AtomicU32::new(QueueSize::ENDLESS.full),
            brake: BrakeOrders::new(),
        }
    }

    /// The sum of the steps at the pins, x and y, as counted last; wraps.
    pub fn steps(&self) -> (i32, i32) {
        let [x, y] = [&self.x, &self.y].map(|sum| sum.load(Ordering::Relaxed).cast_signed());
        (x, y)
    }

    /// The sum of the steps that took up slack, which [`PulserState::steps`] leaves out; wraps.
    pub fn slack(&self) -> (i32, i32) {
        let [x, y] =
            [&self.slack_x, &self.slack_y].map(|sum| sum.load(Ordering::Relaxed).cast_signed());
        (x, y)
    }

    /// The sum of the steps of the pen's motor, down is up; wraps.
    pub fn lift(&self) -> i32 {
        self.lift.load(Ordering::Relaxed).cast_signed()
    }

    /// The pen's motor made a step. For whoever counts them.
    pub fn count_lift(&self, down: bool) {
        add(&self.lift, if down { 1 } else { u32::MAX });
    }

    /// Ticks of the events taken from the queue; wraps.
    pub fn ticks(&self) -> u32 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// How often the queue ran dry while the machine moved; wraps.
    pub fn underruns(&self) -> u32 {
        self.underruns.load(Ordering::Relaxed)
    }

    /// Whether the last event has been worked off and its time is over.
    pub fn is_drained(&self) -> bool {
        self.drained.load(Ordering::Acquire)
    }

    /// No pulse leaves from now on; the interrupt raises the pen, and the main loop throws the queue away.
    /// Call [`Pulser::tick`] at once, or the pen stays down until the event in work ends.
    pub fn halt(&self) {
        self.halt.store(true, Ordering::Release);
    }

    /// Events wait that the interrupt does not know of.
    pub(super) fn fill(&self) {
        self.drained.store(false, Ordering::Release);
    }

    /// Whether [`PulserState::halt`] is in force.
    pub fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Acquire)
    }

    /// Allows pulses again. Only after [`PulserState::is_drained`].
    pub fn release(&self) {
        self.halt.store(false, Ordering::Release);
    }

    /// Adds what was taken from the queue, steps packed as in [`PACKED_STEPS`], less than 2^15 each.
    fn count(&self, steps: u32, slack: u32, ticks: u32) {
        for (x, y, packed) in [(&self.x, &self.y, steps), (&self.slack_x, &self.slack_y, slack)] {
            let dx = i32::from(packed as u16 as i16).cast_unsigned();
            add(x, dx);
            add(y, (packed.wrapping_sub(dx).cast_signed() >> 16).cast_unsigned());
        }
        add(&self.ticks, ticks);
    }

    /// For a board whose steps are not pulsed by [`Pulser`]: what its hardware has done.
    pub fn report(&self, (x, y): (i32, i32), ticks: u32, drained: bool) {
        self.x.store(x.cast_unsigned(), Ordering::Relaxed);
        self.y.store(y.cast_unsigned(), Ordering::Relaxed);
        self.ticks.store(ticks, Ordering::Relaxed);
        self.drained.store(drained, Ordering::Release);
    }

    /// The same for steps that take up slack.
    pub fn report_slack(&self, (x, y): (i32, i32)) {
        self.slack_x.store(x.cast_unsigned(), Ordering::Relaxed);
        self.slack_y.store(y.cast_unsigned(), Ordering::Relaxed);
    }

    /// The queue ran dry while the machine moved.
    pub fn note_underrun(&self) {
        let underruns = self.underruns.load(Ordering::Relaxed);
        self.underruns.store(underruns.wrapping_add(1), Ordering::Relaxed);
    }

    /// Width of a pulse.
    pub fn pulse_ticks(&self) -> u32 {
        self.pulse_ticks.load(Ordering::Relaxed)
    }

    /// Which direction pins are inverted (bit 0 x, bit 1 y).
    pub fn inverted(&self) -> u8 {
        self.inverted.load(Ordering::Relaxed)
    }

    /// Whether the direction pin of the pen's motor is inverted.
    pub fn lift_is_inverted(&self) -> bool {
        self.lift_inverted.load(Ordering::Relaxed)
    }

    /// Width of a pulse, and which direction pins are inverted (bit 0 x, bit 1 y, bit 2 the pen's motor).
    pub(super) fn configure(&self, pulse_ticks: u32, inverted: u8) {
        self.pulse_ticks.store(pulse_ticks, Ordering::Relaxed);
        self.inverted.store(inverted & 3, Ordering::Relaxed);
        self.lift_inverted.store(inverted & 4 != 0, Ordering::Relaxed);
    }

    /// What the board's queue holds; before the machine asks.
    pub fn set_queue(&self, queue: QueueSize) {
        self.queue_steps.store(queue.steps, Ordering::Relaxed);
        self.queue_full.store(queue.full, Ordering::Relaxed);
    }

    /// The same; without a board it has no end.
    pub(super) fn queue(&self) -> QueueSize {
        QueueSize {
            steps: self.queue_steps.load(Ordering::Relaxed),
            full: self.queue_full.load(Ordering::Relaxed),
        }
    }

    /// How a queue that runs dry brakes.
    pub fn brake(&self) -> &BrakeOrders {
        &self.brake
    }
}

/// The main loop's end of the interrupt's queue.
#[derive(Debug)]
pub struct StepQueue<'q, const N: usize> {
    ring: &'q EventRing<N>,
    state: &'q PulserState,
    order: &'static PinOrder,
    /// Of the steps put in last, in units of the brake's rule.
    step_length: StepLength,
    /// The place behind the word counted last.
    counted: u32,
    /// Something follows the event counted last.
    moving: bool,
}

impl<const N: usize> StepQueue<'_, N> {
    /// Room for what is told of some of the events.
    const RESERVED: usize = Runner::ROOM;
    /// Events that fit.
    const EVENTS: usize = N - 1 - Self::RESERVED;

    /// Whether no event waits.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// Whether half of the places are taken.
    pub fn is_half_full(&self) -> bool {
        self.ring.waiting() as usize >= N / 2
    }

    /// Whether the last event is over, and [`Pulser::begin`] is to be called for the next.
    pub fn is_stopped(&self) -> bool {
        !self.ring.is_running()
    }

    /// How many events were taken since [`StepQueue::sync_consumed`] was called.
    pub fn taken(&self) -> usize {
        self.ring.taken_behind(self.counted) as usize
    }

    /// Counts what the interrupt has taken since, which makes room, and tells the state. After
    /// [`PulserState::halt`] it throws the queue away.
    pub fn sync_consumed(&mut self) {
        let stopped = !self.ring.is_running();
        let down = self.state.inverted() << 2;
        let (mut steps, mut slack, mut ticks) = (0u32, 0u32, 0u32);
        let moving = &mut self.moving;
        self.ring.count(&mut self.counted, |word| {
            let (event, flags) = (StepEvent::from_bits(word), word as u8);
            if event.is_told() {
                return;
            }
            ticks = ticks.wrapping_add(word >> 8);
            *moving = flags & (StepEvent::AT_REST | StepEvent::PEN) == 0;
            match event.kind() {
                EventKind::Levels(_) => {}
                EventKind::Lift { step: true, down } => return self.state.count_lift(down),
                EventKind::Lift { .. } | EventKind::Pen { .. } => return,
            }
            let levels = self.order.levels[usize::from(flags & LEVELS)] ^ down;
            let step = PACKED_STEPS[usize::from(levels & STEPS)];
            let sum = if flags & StepEvent::AT_REST == 0 { &mut steps } else { &mut slack };
            *sum = sum.wrapping_add(step);
        });
        self.state.count(steps, slack, ticks);
        if stopped && core::mem::take(&mut self.moving) && !self.state.is_halted() {
            self.state.note_underrun();
        }
        if stopped && self.state.is_halted() {
            self.ring.clear();
            self.state.brake.forget();
            self.step_length = StepLength::new();
        }
        self.state.drained.store(stopped, Ordering::Release);
    }
}

impl<const N: usize> EventQueue for StepQueue<'_, N> {
    fn room(&self) -> usize {
        self.ring.room(self.counted).saturating_sub(Self::RESERVED)
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        let is_no_step =
            event.is_slack() || matches!(event.kind(), EventKind::Lift { step: true, .. });
        if self.ring.room(self.counted) <= usize::from(is_no_step) {
            return Err(event);
        }
        self.state.drained.store(false, Ordering::Relaxed);
        if is_no_step {
            self.ring.put(StepEvent::skip_next().to_bits());
        }
        let mut word = event.to_bits();
        let flags = word as u8;
        if matches!(event.kind(), EventKind::Levels(_)) {
            let levels = (flags ^ self.state.inverted() << 2) & LEVELS;
            let pins = self.order.pins[usize::from(levels)];
            word = word & !u32::from(LEVELS) | u32::from(pins);
        }
        self.ring.put(word);
        if event.is_step() {
            self.state.brake.add(self.step_length.step().around);
        }
        Ok(())
    }

    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        if units != self.step_length.last() {
            let start = self.step_length.start(after_next);
            let word = StepEvent::step_length(units, start);
            if self.ring.room(self.counted) == 0 {
                return Err(word);
            }
            self.ring.put(word.to_bits());
            self.step_length.set_from(units, start);
        }
        Ok(())
    }
}

/// The pins of a machine. High steps, high direction counts up (unless inverted), high enable
/// switches the drivers on; a board that needs it otherwise wraps its pin.
#[derive(Debug)]
pub struct Pins<SX, DX, SY, DY, E, SZ, DZ> {
    /// Steps of x.
    pub step_x: SX,
    /// Direction of x.
    pub direction_x: DX,
    /// Steps of y.
    pub step_y: SY,
    /// Direction of y.
    pub direction_y: DY,
    /// All drivers.
    pub enable: E,
    /// Steps of the pen's motor.
    pub step_z: SZ,
    /// Its direction: high lowers the pen.
    pub direction_z: DZ,
}

/// Which of the axes' pins has which bit where they are written: at most 5 of them.
#[derive(Debug)]
pub struct PinOrder {
    /// The pins' levels for those of a [`StepEvent`].
    pins: [u8; 32],
    /// And the other way round.
    levels: [u8; 32],
    /// The step pins.
    pulses: u8,
}

impl PinOrder {
    /// As in a [`StepEvent`].
    pub const OF_EVENTS: Self = Self::new([0, 1, 2, 3, 4], 0);

    /// Where the event's bits 0 to 4 are among the pins, each a different one of 0 to 4, and which of the pins are
    /// inverted.
    pub const fn new(places: [u8; 5], inverted: u8) -> Self {
        let (mut pins, mut levels, mut pulses) = ([0; 32], [0; 32], 0);
        let mut event = 0u8;
        while event < 32 {
            let (mut moved, mut bit) = (0, 0);
            while bit < 5 {
                moved |= (event >> bit & 1) << places[bit];
                bit += 1;
            }
            if event == StepEvent::STEP_X | StepEvent::STEP_Y {
                pulses = moved;
            }
            pins[event as usize] = moved ^ inverted;
            levels[(moved ^ inverted) as usize] = event;
            event += 1;
        }
        Self { pins, levels, pulses }
    }
}

/// The axes' pins, set all at once.
pub trait Axes {
    /// How they lie; steps are not inverted.
    const ORDER: &'static PinOrder = &PinOrder::OF_EVENTS;
    /// The pins take `levels`, in bits 0 to 4 as [`Axes::ORDER`] says, the others mean nothing. In a
    /// [`StepEvent`]'s order: a high pulse for each step, the level of each direction pin where a motor
    /// runs down, drivers on. Called from the interrupt, so brief.
    fn set(&mut self, levels: u32);
    /// The pen's motor takes a direction, high to lower the pen, and a step if asked. Called from the
    /// interrupt, too.
    fn set_lift(&mut self, step: bool, down: bool);
    /// The pulses end. Called from the interrupt, too.
    fn end_pulses(&mut self);
}

impl<SX, DX, SY, DY, E, SZ, DZ> Axes for Pins<SX, DX, SY, DY, E, SZ, DZ>
where
    SX: OutputPin<Error = Infallible>,
    DX: OutputPin<Error = Infallible>,
    SY: OutputPin<Error = Infallible>,
    DY: OutputPin<Error = Infallible>,
    E: OutputPin<Error = Infallible>,
    SZ: OutputPin<Error = Infallible>,
    DZ: OutputPin<Error = Infallible>,
{
    fn set(&mut self, levels: u32) {
        let is_set = |level: u8| levels & u32::from(level) != 0;
        write(&mut self.direction_x, !is_set(StepEvent::DOWN_X));
        write(&mut self.direction_y, !is_set(StepEvent::DOWN_Y));
        write(&mut self.enable, is_set(StepEvent::DRIVERS_ON));
        write(&mut self.step_x, is_set(StepEvent::STEP_X));
        write(&mut self.step_y, is_set(StepEvent::STEP_Y));
    }

    fn set_lift(&mut self, step: bool, down: bool) {
        write(&mut self.direction_z, down);
        write(&mut self.step_z, step);
    }

    fn end_pulses(&mut self) {
        write(&mut self.step_x, false);
        write(&mut self.step_y, false);
        write(&mut self.step_z, false);
    }
}

/// The pen: a solenoid's pin or a servo.
pub trait Pen {
    /// Goes to `height`, 0 (fully raised) to 127. Called from the interrupt, so brief.
    fn set_height(&mut self, height: u8);
}

/// A pen with two positions at one pin: high is down, from height 64 on.
#[derive(Debug)]
pub struct Solenoid<P>(pub P);

impl<P: OutputPin<Error = Infallible>> Pen for Solenoid<P> {
    #[inline]
    fn set_height(&mut self, height: u8) {
        write(&mut self.0, height >= 64);
    }
}

/// The work of the step interrupt.
///
/// A move takes two calls, [`Pulser::tick`] that raises the step pins and [`Pulser::end_pulses`], and some
/// more of [`Pulser::brake`] where the queue may run dry at speed. No division, no loop, no lock. What the
/// interrupt costs is said and measured where the board has it.
#[derive(Debug)]
pub struct Pulser<'q, A, P, const N: usize> {
    axes: A,
    pen: P,
    ring: &'q EventRing<N>,
    state: &'q PulserState,
    /// Ticks of the event in work.
    ticks: u32,
    /// Keeps a queue that runs dry from stopping the machine with a jerk.
    brake: StepBrake,
}

/// What [`Pulser::tick`] found in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tick {
    /// An event has begun.
    Begun {
        /// When the next is due, from the time on at which this one was.
        ticks: u32,
        /// Whether [`Pulser::end_pulses`] is due [`PulserState::pulse_ticks`] from now.
        pulses: bool,
    },
    /// No event: first [`Pulser::brake`] is due at once, then the next tick.
    Told,
    /// Nothing, or no more is wanted: the event in work was the last.
    Over,
}

impl<'q, A: Axes, P: Pen, const N: usize> Pulser<'q, A, P, N> {
    /// A pulser at rest, and the other end of its queue. The pins stay as they are until the first
    /// event.
    pub fn new(
        axes: A,
        pen: P,
        ring: &'q mut EventRing<N>,
        state: &'q PulserState,
    ) -> (Self, StepQueue<'q, N>) {
        let ring = &*ring;
        state.set_queue(QueueSize { steps: StepQueue::<N>::EVENTS as u32, ..QueueSize::ENDLESS });
        let pulser = Self { axes, pen, ring, state, ticks: 0, brake: StepBrake::new() };
        let counted = ring.taken_place();
        let step_length = StepLength::new();
        (pulser, StepQueue { ring, state, order: A::ORDER, step_length, counted, moving: false })
    }

    /// Before the first event, and again after [`Tick::Over`]. Whether there is anything to do.
    pub fn begin(&mut self) -> bool {
        let has_work = !self.ring.is_empty() || self.is_halted();
        if has_work {
            self.ring.set_running(true);
        }
        has_work
    }

    /// The next event.
    #[inline(always)]
    pub fn tick(&mut self) -> Tick {
        const RARE: u32 = (StepEvent::LENGTH | StepEvent::PEN) as u32;
        if self.is_halted() {
            self.stop();
            return Tick::Over;
        }
        let Some(word) = self.ring.take() else {
            self.run_dry();
            return Tick::Over;
        };
        let ticks = word >> 8;
        if word & RARE == 0 {
            self.axes.set(word);
            self.ticks = ticks;
            return Tick::Begun { ticks, pulses: word & u32::from(A::ORDER.pulses) != 0 };
        }
        let event = StepEvent::from_bits(word);
        if event.is_told() {
            self.brake.tell(event);
            return Tick::Told;
        }
        match event.kind() {
            EventKind::Pen { height } => self.pen.set_height(height),
            EventKind::Lift { step, down } => {
                self.axes.set_lift(step, down != self.state.lift_is_inverted());
                return Tick::Begun { ticks, pulses: step };
            }
            // Done above.
            EventKind::Levels(_) => {}
        }
        Tick::Begun { ticks, pulses: false }
    }

    /// Nothing else is read by it, so it needs no order.
    #[inline(always)]
    pub fn is_halted(&self) -> bool {
        self.state.halt.load(Ordering::Relaxed)
    }

    /// The pulses of an event end. Whether [`Pulser::brake`] is due at once.
    #[inline(always)]
    pub fn end_pulses(&mut self) -> bool {
        self.axes.end_pulses();
        self.brake.step(&self.state.brake)
    }

    /// Whether this is due once more, and by how many ticks the event in work must last longer than was planned: with fewer
    /// steps waiting the machine would be too fast to stop within them.
    #[inline(always)]
    pub fn brake(&mut self) -> (bool, u32) {
        let (is_due, least) = self.brake.work(&self.state.brake);
        (is_due, least.saturating_sub(self.ticks))
    }

    /// The ticks of what comes between the event in work and the next step, which count where the first is lengthened.
    pub fn wait_behind(&self) -> u32 {
        let others = A::ORDER.pulses | StepEvent::AT_REST | StepEvent::LENGTH | StepEvent::PEN;
        match self.ring.peek() {
            Some(word) if word as u8 & others == 0 => word >> 8,
            _ => 0,
        }
    }

    /// Raises the pen; the event in work was the last.
    #[cold]
    #[inline(never)]
    pub fn stop(&mut self) {
        self.pen.set_height(0);
        self.brake.stop();
        self.ring.set_running(false);
    }

    #[cold]
    #[inline(never)]
    fn run_dry(&mut self) {
        self.brake.rest();
        self.ring.set_running(false);
    }
}

#[inline]
fn write(pin: &mut impl OutputPin<Error = Infallible>, high: bool) {
    let Ok(()) = pin.set_state(PinState::from(high));
}

/// All that an event says of the axes' pins.
const LEVELS: u8 = (1 << 5) - 1;

/// Pulses and directions of the levels.
const STEPS: u8 = StepEvent::STEP_X | StepEvent::STEP_Y | StepEvent::DOWN_X | StepEvent::DOWN_Y;

/// What they add to x in the lower half and to y in the upper one.
const PACKED_STEPS: [u32; 16] = {
    let mut table = [0; 16];
    let mut levels = 0;
    while levels < 16u8 {
        let (dx, dy) = StepEvent::levels(levels, 0).step();
        table[levels as usize] = (dx as u32).wrapping_add((dy as u32) << 16);
        levels += 1;
    }
    table
};

/// Only for the one that writes it: a load and a store, so that a Cortex-M0+ can.
#[inline]
fn add(sum: &AtomicU32, more: u32) {
    sum.store(sum.load(Ordering::Relaxed).wrapping_add(more), Ordering::Relaxed);
}
