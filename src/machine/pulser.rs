//! The step interrupt's work, and what it tells the main loop.

use crate::motion::{Brake, BrakeOrders, EventKind, EventQueue, QueueSize, StepEvent, StepLength};
use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use embedded_hal::digital::{OutputPin, PinState};
use heapless::spsc::{Consumer, Producer, Queue};

/// What the interrupt and the main loop share. Only loads and stores, so a Cortex-M0+ has it too.
///
/// The interrupt alone writes the counts, the main loop alone the orders and the sums of the counts.
#[derive(Debug, Default)]
pub struct PulserState {
    /// The steps of x and y, packed as in [`PACKED_STEPS`]; wraps.
    packed: AtomicU32,
    /// As much of it as is in the sums.
    summed: AtomicU32,
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
    queue_rate: AtomicU32,
    brake: BrakeOrders,
}

impl PulserState {
    /// Nothing counted, nothing ordered.
    pub const fn new() -> Self {
        Self {
            packed: AtomicU32::new(0),
            summed: AtomicU32::new(0),
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
            queue_rate: AtomicU32::new(QueueSize::ENDLESS.greatest_rate),
            brake: BrakeOrders::new(),
        }
    }

    /// The sum of the steps at the pins, x and y; wraps. For the main loop alone, and at least once in
    /// 2^15 steps.
    pub fn steps(&self) -> (i32, i32) {
        let packed = self.packed.load(Ordering::Relaxed);
        let more = packed.wrapping_sub(self.summed.load(Ordering::Relaxed));
        self.summed.store(packed, Ordering::Relaxed);
        let dx = i32::from(more as u16 as i16).cast_unsigned();
        add(&self.x, dx);
        add(&self.y, (more.wrapping_sub(dx).cast_signed() >> 16).cast_unsigned());
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

    /// The pen's motor made a step. For the interrupt that pulses it.
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

    /// No pulse leaves from now on; the interrupt raises the pen and throws the queue away, one
    /// event a call. Call [`Pulser::tick`] at once, or the pen stays down until the event in work
    /// ends.
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

    /// For such a board: its queue ran dry while the machine moved.
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
        self.queue_rate.store(queue.greatest_rate, Ordering::Relaxed);
    }

    /// The same; without a board it has no end.
    pub(super) fn queue(&self) -> QueueSize {
        QueueSize {
            steps: self.queue_steps.load(Ordering::Relaxed),
            greatest_rate: self.queue_rate.load(Ordering::Relaxed),
        }
    }

    /// How a queue that runs dry brakes.
    pub fn brake(&self) -> &BrakeOrders {
        &self.brake
    }
}

/// The main loop's end of the interrupt's queue.
pub struct StepQueue<'q> {
    events: Producer<'q, StepEvent>,
    state: &'q PulserState,
    /// Of the steps put in last, in units of the brake's rule.
    step_length: StepLength,
}

impl core::fmt::Debug for StepQueue<'_> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("StepQueue").field("len", &self.events.len()).finish_non_exhaustive()
    }
}

impl StepQueue<'_> {
    /// Whether no event waits.
    pub fn is_empty(&self) -> bool {
        self.events.is_empty()
    }

    /// Whether half of the places are taken.
    pub fn is_half_full(&self) -> bool {
        self.events.len() >= self.events.capacity() / 2
    }
}

impl EventQueue for StepQueue<'_> {
    fn room(&self) -> usize {
        self.events.capacity() - self.events.len()
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.events.enqueue(event)?;
        if event.is_step() {
            self.state.brake.add(self.step_length.step().around);
        }
        Ok(())
    }

    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        if units != self.step_length.last() {
            self.events.enqueue(StepEvent::step_length(units, after_next))?;
            self.step_length.set(units, after_next);
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

/// The axes' pins, set all at once.
pub trait Axes {
    /// The pins take `levels`, bits as in [`StepEvent`]: a high pulse for each step, the level of
    /// each direction pin where a motor runs down, drivers on. Called from the interrupt, so brief.
    fn set(&mut self, levels: u8);
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
    fn set(&mut self, levels: u8) {
        write(&mut self.direction_x, levels & StepEvent::DOWN_X == 0);
        write(&mut self.direction_y, levels & StepEvent::DOWN_Y == 0);
        write(&mut self.enable, levels & StepEvent::DRIVERS_ON != 0);
        write(&mut self.step_x, levels & StepEvent::STEP_X != 0);
        write(&mut self.step_y, levels & StepEvent::STEP_Y != 0);
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

/// The step interrupt: pops an event, writes pins, says when to be called next.
///
/// A move takes two calls, one that raises the step pins and one that lowers them. No division, no
/// loop, no lock. What the whole interrupt costs is said and measured where the board has it.
pub struct Pulser<'q, A, P> {
    axes: A,
    pen: P,
    events: Consumer<'q, StepEvent>,
    state: &'q PulserState,
    /// Ticks of the event whose pulse is high; 0 if none is.
    step_ticks: u32,
    /// Keeps a queue that runs dry from stopping the machine with a jerk.
    brake: Brake,
    step_length: StepLength,
    /// The levels of the event whose pulse is high: it counts when the pulse ends.
    pulse: u8,
    moving: bool,
}

impl<A, P> core::fmt::Debug for Pulser<'_, A, P> {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.debug_struct("Pulser").field("state", &self.state).finish_non_exhaustive()
    }
}

impl<'q, A: Axes, P: Pen> Pulser<'q, A, P> {
    /// Ticks between two calls while there is nothing to do: 1 ms.
    pub const IDLE_TICKS: u32 = 25_000;

    /// A pulser at rest, and the other end of its queue. The pins stay as they are until the first
    /// event.
    pub fn new<const N: usize>(
        axes: A,
        pen: P,
        queue: &'q mut Queue<StepEvent, N>,
        state: &'q PulserState,
    ) -> (Self, StepQueue<'q>) {
        let (producer, events) = queue.split();
        state.set_queue(QueueSize { steps: producer.capacity() as u32, ..QueueSize::ENDLESS });
        let (brake, step_length) = (Brake::default(), StepLength::default());
        let pulser = Self {
            axes,
            pen,
            events,
            state,
            step_ticks: 0,
            brake,
            step_length,
            pulse: 0,
            moving: false,
        };
        (pulser, StepQueue { events: producer, state, step_length: StepLength::default() })
    }

    /// The work of one interrupt. Returns the ticks until the next, counted from the start of this
    /// one; `None` if there is nothing to do (call again when something is in the queue, or after
    /// [`Pulser::IDLE_TICKS`]).
    #[inline(always)]
    pub fn tick(&mut self) -> Option<u32> {
        if self.step_ticks != 0 {
            self.axes.end_pulses();
            let mut ticks = core::mem::take(&mut self.step_ticks);
            if self.pulse & StepEvent::AT_REST == 0 {
                add(&self.state.packed, PACKED_STEPS[usize::from(self.pulse & STEPS)]);
                let least = self.brake.step(self.step_length.step(), &self.state.brake);
                if least > ticks {
                    ticks = ticks.max(self.without_what_follows(least));
                }
            } else {
                self.count_slack();
            }
            if self.halted() {
                return Some(Self::DISCARD_TICKS);
            }
            let pulse = self.state.pulse_ticks.load(Ordering::Relaxed);
            return Some(if ticks > pulse { ticks - pulse } else { 1 });
        }
        let Some(event) = self.events.dequeue() else {
            return self.run_dry();
        };
        if event.is_aside() {
            return Some(self.take_aside(event));
        }
        if self.halted() {
            return Some(self.throw_away(event));
        }
        self.state.drained.store(false, Ordering::Relaxed);
        add(&self.state.ticks, event.ticks());
        match event.kind() {
            EventKind::Levels(levels) => Some(self.set_levels(levels, event)),
            EventKind::Pen { height } => {
                self.moving = false;
                self.pen.set_height(height);
                Some(event.ticks())
            }
            // Taken aside above.
            EventKind::Lift { .. } => None,
        }
    }

    /// Nothing else is read by it, so it needs no order.
    #[inline(always)]
    fn halted(&self) -> bool {
        self.state.halt.load(Ordering::Relaxed)
    }

    /// Whether a pulse is high: [`Pulser::tick`] must not be called before its time.
    #[inline]
    pub fn pulse_is_high(&self) -> bool {
        self.step_ticks != 0
    }

    /// Raises the pen and switches the drivers off, whatever waits: for a panic or a fault.
    pub fn shut_down(&mut self) {
        self.pen.set_height(0);
        self.axes.set(0);
    }

    /// One thrown away event in 4 µs: 512 of them are gone in 2 ms, and other interrupts get
    /// their turn.
    const DISCARD_TICKS: u32 = 100;

    /// The ticks from one step to the next, less those of an event between the two.
    #[cold]
    #[inline(never)]
    fn without_what_follows(&self, ticks: u32) -> u32 {
        let next = self.events.peek().filter(|next| next.is_wait());
        ticks.saturating_sub(next.map_or(0, |wait| wait.ticks()))
    }

    #[cold]
    #[inline(never)]
    fn count_slack(&self) {
        let steps = PACKED_STEPS[usize::from(self.pulse & STEPS)];
        let dx = i32::from(steps as u16 as i16).cast_unsigned();
        add(&self.state.slack_x, dx);
        add(&self.state.slack_y, (steps.wrapping_sub(dx).cast_signed() >> 16).cast_unsigned());
    }

    /// A length of steps takes no time: the next call is due at once.
    #[cold]
    #[inline(never)]
    fn take_aside(&mut self, event: StepEvent) -> u32 {
        if let Some((units, after_next)) = event.as_step_length() {
            self.step_length.set(units, after_next);
            return 0;
        }
        let EventKind::Lift { step, down } = event.kind() else { return 0 };
        if self.halted() {
            return self.throw_away(event);
        }
        self.state.drained.store(false, Ordering::Relaxed);
        add(&self.state.ticks, event.ticks());
        self.axes.set_lift(step, down != self.state.lift_is_inverted());
        self.moving = true;
        if !step {
            return event.ticks();
        }
        self.state.count_lift(down);
        // Ends as a pulse that is no way of x and y.
        self.pulse = StepEvent::AT_REST;
        self.step_ticks = event.ticks().max(1);
        self.state.pulse_ticks()
    }

    #[cold]
    #[inline(never)]
    fn throw_away(&mut self, event: StepEvent) -> u32 {
        if event.is_step() {
            self.brake.skip(self.step_length.step().around);
        }
        self.moving = false;
        self.pen.set_height(0);
        Self::DISCARD_TICKS
    }

    #[inline(never)]
    fn run_dry(&mut self) -> Option<u32> {
        let halted = self.state.is_halted();
        if halted {
            self.pen.set_height(0);
        }
        if core::mem::take(&mut self.moving) && !halted {
            self.state.note_underrun();
        }
        self.state.drained.store(true, Ordering::Release);
        None
    }

    #[inline(always)]
    fn set_levels(&mut self, levels: u8, event: StepEvent) -> u32 {
        const PULSES: u8 = StepEvent::STEP_X | StepEvent::STEP_Y;
        let inverted = self.state.inverted.load(Ordering::Relaxed);
        let pins = levels ^ (inverted << 2);
        self.axes.set(pins);
        self.moving = levels & StepEvent::AT_REST == 0;
        if levels & PULSES == 0 {
            return event.ticks();
        }
        self.pulse = levels;
        self.step_ticks = event.ticks().max(1);
        self.state.pulse_ticks.load(Ordering::Relaxed)
    }
}

#[inline]
fn write(pin: &mut impl OutputPin<Error = Infallible>, high: bool) {
    let Ok(()) = pin.set_state(PinState::from(high));
}

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
#[inline(always)]
fn add(sum: &AtomicU32, more: u32) {
    sum.store(sum.load(Ordering::Relaxed).wrapping_add(more), Ordering::Relaxed);
}
