//! The step interrupt: takes events from the queue, sets the pins, and reports the counts to the
//! main loop.

use super::ring::EventRing;
use crate::motion::{
    BrakeOrders, EventKind, EventQueue, QueueSize, Runner, StepBrake, StepEvent, StepLength,
};
use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use embedded_hal::digital::{OutputPin, PinState};

/// The state that the interrupt and the main loop share. It needs only atomic loads and stores, so
/// a Cortex-M0+ supports it.
///
/// Only the main loop writes the commands, and it also writes the counts of the events that it
/// finds to be taken.
#[derive(Debug, Default)]
pub struct PulserState {
    /// The sum of the steps of x, as a wrapping `i32`.
    x: AtomicU32,
    /// The sum of the steps of y, as a wrapping `i32`.
    y: AtomicU32,
    /// The sum of the steps of x that took up slack, as a wrapping `i32`.
    slack_x: AtomicU32,
    /// The sum of the steps of y that took up slack, as a wrapping `i32`.
    slack_y: AtomicU32,
    /// The position of the pen's motor in steps downward, as a wrapping `i32`.
    lift: AtomicU32,
    /// The sum of the ticks of the events taken from the queue; it wraps.
    ticks: AtomicU32,
    /// The number of underruns: the queue ran empty while the machine moved; it wraps.
    underruns: AtomicU32,
    /// Whether the last event has been processed and its time is over.
    drained: AtomicBool,
    /// Whether the main loop has halted the pulses.
    halt: AtomicBool,
    /// The width of a step pulse, in ticks.
    pulse_ticks: AtomicU32,
    /// The mask of inverted direction pins: bit 0 for x, bit 1 for y.
    inverted: AtomicU8,
    /// Whether the direction pin of the pen's motor is inverted.
    lift_inverted: AtomicBool,
    /// The field `steps` of the size of the board's queue.
    queue_steps: AtomicU32,
    /// The field `full` of the size of the board's queue.
    queue_full: AtomicU32,
    /// How the interrupt brakes when its queue runs empty.
    brake: BrakeOrders,
}

impl PulserState {
    /// The state with all counts at 0 and no commands.
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

    /// The sum of the steps made at the pins so far, for x and y, as last counted; it wraps.
    pub fn steps(&self) -> (i32, i32) {
        let [x, y] = [&self.x, &self.y].map(|sum| sum.load(Ordering::Relaxed).cast_signed());
        (x, y)
    }

    /// The sum of the steps that took up slack, which [`PulserState::steps`] does not include; it
    /// wraps.
    pub fn slack(&self) -> (i32, i32) {
        let [x, y] =
            [&self.slack_x, &self.slack_y].map(|sum| sum.load(Ordering::Relaxed).cast_signed());
        (x, y)
    }

    /// The position of the pen's motor, in steps downward; it wraps.
    pub fn lift(&self) -> i32 {
        self.lift.load(Ordering::Relaxed).cast_signed()
    }

    /// Counts a step of the pen's motor. For the code that counts the steps.
    pub fn count_lift(&self, down: bool) {
        add(&self.lift, if down { 1 } else { u32::MAX });
    }

    /// The sum of the ticks of the events that were taken from the queue; it wraps.
    pub fn ticks(&self) -> u32 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// How often the queue ran empty while the machine moved; the count wraps.
    pub fn underruns(&self) -> u32 {
        self.underruns.load(Ordering::Relaxed)
    }

    /// Whether the last event has been processed and its time is over.
    pub fn is_drained(&self) -> bool {
        self.drained.load(Ordering::Acquire)
    }

    /// Stops all pulses from now on. The interrupt raises the pen, and the main loop discards the
    /// queue. Call [`Pulser::tick`] at once; otherwise the pen stays down until the current event
    /// ends.
    pub fn halt(&self) {
        self.halt.store(true, Ordering::Release);
    }

    /// Records that events are waiting that the interrupt does not know of.
    pub(super) fn fill(&self) {
        self.drained.store(false, Ordering::Release);
    }

    /// Whether [`PulserState::halt`] is in force.
    pub fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Acquire)
    }

    /// Allows pulses again. Call it only after [`PulserState::is_drained`] is true.
    pub fn release(&self) {
        self.halt.store(false, Ordering::Release);
    }

    /// Adds the steps and ticks of the events that were taken from the queue. Steps are packed as
    /// in [`PACKED_STEPS`], with less than 2^15 for each motor.
    fn count(&self, steps: u32, slack: u32, ticks: u32) {
        for (x, y, packed) in [(&self.x, &self.y, steps), (&self.slack_x, &self.slack_y, slack)] {
            let dx = i32::from(packed as u16 as i16).cast_unsigned();
            add(x, dx);
            add(y, (packed.wrapping_sub(dx).cast_signed() >> 16).cast_unsigned());
        }
        add(&self.ticks, ticks);
    }

    /// Reports what the hardware has done, for a board whose steps are not pulsed by [`Pulser`]:
    /// the sums of the steps and ticks, and whether the queue is drained.
    pub fn report(&self, (x, y): (i32, i32), ticks: u32, drained: bool) {
        self.x.store(x.cast_unsigned(), Ordering::Relaxed);
        self.y.store(y.cast_unsigned(), Ordering::Relaxed);
        self.ticks.store(ticks, Ordering::Relaxed);
        self.drained.store(drained, Ordering::Release);
    }

    /// Reports the sums of the steps that took up slack, for such a board.
    pub fn report_slack(&self, (x, y): (i32, i32)) {
        self.slack_x.store(x.cast_unsigned(), Ordering::Relaxed);
        self.slack_y.store(y.cast_unsigned(), Ordering::Relaxed);
    }

    /// Counts that the queue ran empty while the machine moved.
    pub fn note_underrun(&self) {
        let underruns = self.underruns.load(Ordering::Relaxed);
        self.underruns.store(underruns.wrapping_add(1), Ordering::Relaxed);
    }

    /// The width of a step pulse, in ticks.
    pub fn pulse_ticks(&self) -> u32 {
        self.pulse_ticks.load(Ordering::Relaxed)
    }

    /// The mask of inverted direction pins: bit 0 for x, bit 1 for y.
    pub fn inverted(&self) -> u8 {
        self.inverted.load(Ordering::Relaxed)
    }

    /// Whether the direction pin of the pen's motor is inverted.
    pub fn lift_is_inverted(&self) -> bool {
        self.lift_inverted.load(Ordering::Relaxed)
    }

    /// Sets the width of a pulse in ticks, and the mask of inverted direction pins: bit 0 for x,
    /// bit 1 for y, bit 2 for the pen's motor.
    pub(super) fn configure(&self, pulse_ticks: u32, inverted: u8) {
        self.pulse_ticks.store(pulse_ticks, Ordering::Relaxed);
        self.inverted.store(inverted & 3, Ordering::Relaxed);
        self.lift_inverted.store(inverted & 4 != 0, Ordering::Relaxed);
    }

    /// Sets the size of the board's queue. Call it before the machine asks for the size.
    pub fn set_queue(&self, queue: QueueSize) {
        self.queue_steps.store(queue.steps, Ordering::Relaxed);
        self.queue_full.store(queue.full, Ordering::Relaxed);
    }

    /// The size of the board's queue. Without a board it is unlimited.
    pub(super) fn queue(&self) -> QueueSize {
        QueueSize {
            steps: self.queue_steps.load(Ordering::Relaxed),
            full: self.queue_full.load(Ordering::Relaxed),
        }
    }

    /// How the interrupt brakes when its queue runs empty.
    pub fn brake(&self) -> &BrakeOrders {
        &self.brake
    }
}

/// The main loop's end of the interrupt's queue.
#[derive(Debug)]
pub struct StepQueue<'q, const N: usize> {
    /// The ring buffer of the events.
    ring: &'q EventRing<N>,
    /// The state shared with the interrupt.
    state: &'q PulserState,
    /// The order of the axes' pins in the words of the ring.
    order: &'static PinOrder,
    /// The length of the steps that were put in last, in units of the brake's rule.
    step_length: StepLength,
    /// The slot after the word that was counted last.
    counted: u32,
    /// Whether the machine is in motion after the event that was counted last.
    moving: bool,
}

impl<const N: usize> StepQueue<'_, N> {
    /// Slots that are reserved for words that only carry information about some of the events.
    const RESERVED: usize = Runner::ROOM;
    /// The number of events that fit.
    const EVENTS: usize = N - 1 - Self::RESERVED;

    /// Whether no event waits.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// Whether at least half of the slots are taken.
    pub fn is_half_full(&self) -> bool {
        self.ring.waiting() as usize >= N / 2
    }

    /// Whether the last event is over, so that [`Pulser::begin`] must be called for the next one.
    pub fn is_stopped(&self) -> bool {
        !self.ring.is_running()
    }

    /// The number of words that were taken since [`StepQueue::sync_consumed`] was last called.
    pub fn taken(&self) -> usize {
        self.ring.taken_behind(self.counted) as usize
    }

    /// Counts the events that the interrupt has taken since the last call, which frees their slots,
    /// and updates the shared state. After [`PulserState::halt`] it discards the queue.
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

/// The pins of a machine, one by one. A high step pin makes a step, a high direction pin counts up
/// (unless it is inverted), and a high enable pin switches the drivers on. A board with other
/// levels wraps the pin.
#[derive(Debug)]
pub struct Pins<SX, DX, SY, DY, E, SZ, DZ> {
    /// The step pin of x.
    pub step_x: SX,
    /// The direction pin of x.
    pub direction_x: DX,
    /// The step pin of y.
    pub step_y: SY,
    /// The direction pin of y.
    pub direction_y: DY,
    /// The enable pin of all drivers.
    pub enable: E,
    /// The step pin of the pen's motor.
    pub step_z: SZ,
    /// The direction pin of the pen's motor; a high level lowers the pen.
    pub direction_z: DZ,
}

/// The order in which the axes' pins, at most 5, are written: which pin has which bit.
#[derive(Debug)]
pub struct PinOrder {
    /// The levels of the pins for each combination of the levels of a [`StepEvent`].
    pins: [u8; 32],
    /// The levels of a [`StepEvent`] for each combination of the levels of the pins.
    levels: [u8; 32],
    /// The mask of the step pins.
    pulses: u8,
}

impl PinOrder {
    /// The order of the bits in a [`StepEvent`].
    pub const OF_EVENTS: Self = Self::new([0, 1, 2, 3, 4], 0);

    /// Creates the order in which bit i of an event, for i from 0 to 4, is pin number `places[i]`.
    /// The numbers are a permutation of 0 to 4. `inverted` is the mask of inverted pins.
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

/// The axes' pins, which are all set at once.
pub trait Axes {
    /// The order of the pins. Step pins are not inverted.
    const ORDER: &'static PinOrder = &PinOrder::OF_EVENTS;
    /// Sets the pins to `levels`, in bits 0 to 4 in the order of [`Axes::ORDER`]; the other bits
    /// have no meaning. In the order of a [`StepEvent`] they are a high pulse for each step, the
    /// level of each direction pin where a motor runs down, and whether the drivers are on. It is
    /// called from the interrupt, so it must be brief.
    fn set(&mut self, levels: u32);
    /// Sets the direction pin of the pen's motor, high to lower the pen, and makes a step if `step`
    /// is true. It is called from the interrupt, too.
    fn set_lift(&mut self, step: bool, down: bool);
    /// Ends the pulses. It is called from the interrupt, too.
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

/// The actuator of the pen: a solenoid's pin or a servo.
pub trait Pen {
    /// Moves the pen to `height`, from 0 (fully raised) to 127. It is called from the interrupt, so
    /// it must be brief.
    fn set_height(&mut self, height: u8);
}

/// A pen with two positions at one pin. The pin is high, and the pen down, from height 64 on.
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
/// A step takes two calls: [`Pulser::tick`] raises the step pins, and [`Pulser::end_pulses`] lowers
/// them. Some more calls of [`Pulser::brake`] follow where the queue may run empty at speed. There
/// is no division, no loop and no lock. The time that the interrupt takes is documented and
/// measured in the boards' modules.
#[derive(Debug)]
pub struct Pulser<'q, A, P, const N: usize> {
    /// The axes' pins.
    axes: A,
    /// The actuator of the pen.
    pen: P,
    /// The ring buffer of the events.
    ring: &'q EventRing<N>,
    /// The state shared with the main loop.
    state: &'q PulserState,
    /// The ticks of the current event.
    ticks: u32,
    /// Prevents an abrupt stop at speed when the queue runs empty.
    brake: StepBrake,
}

/// What [`Pulser::tick`] found in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tick {
    /// An event has begun.
    Begun {
        /// The time at which the next event is due, in ticks after this event was due.
        ticks: u32,
        /// Whether [`Pulser::end_pulses`] must be called [`PulserState::pulse_ticks`] from now.
        pulses: bool,
    },
    /// The word was no event, but information about later ones. [`Pulser::brake`] is due at once,
    /// then the next tick.
    Told,
    /// The queue is empty or the machine is halted. The current event was the last.
    Over,
}

impl<'q, A: Axes, P: Pen, const N: usize> Pulser<'q, A, P, N> {
    /// Creates a pulser at rest, and the main loop's end of its queue. The pins do not change until
    /// the first event.
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

    /// Call it before the first event, and again after [`Tick::Over`]. Returns whether there is
    /// anything to do.
    pub fn begin(&mut self) -> bool {
        let has_work = !self.ring.is_empty() || self.is_halted();
        if has_work {
            self.ring.set_running(true);
        }
        has_work
    }

    /// Begins the next event.
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
            // These events were handled above.
            EventKind::Levels(_) => {}
        }
        Tick::Begun { ticks, pulses: false }
    }

    /// Whether the pulses are halted. No other data is read because of this flag, so it needs no
    /// memory ordering.
    #[inline(always)]
    pub fn is_halted(&self) -> bool {
        self.state.halt.load(Ordering::Relaxed)
    }

    /// Ends the pulses of an event. Returns whether [`Pulser::brake`] is due at once.
    #[inline(always)]
    pub fn end_pulses(&mut self) -> bool {
        self.axes.end_pulses();
        self.brake.step(&self.state.brake)
    }

    /// Does a part of the brake's work. Returns whether another call is due, and by how many ticks
    /// the current event must last longer than planned. With fewer steps waiting, the machine would
    /// otherwise be too fast to stop within them.
    #[inline(always)]
    pub fn brake(&mut self) -> (bool, u32) {
        let (is_due, least) = self.brake.work(&self.state.brake);
        (is_due, least.saturating_sub(self.ticks))
    }

    /// The ticks of the event between the current one and the next step, or 0. They count as well
    /// where the current event is lengthened.
    pub fn wait_behind(&self) -> u32 {
        let others = A::ORDER.pulses | StepEvent::AT_REST | StepEvent::LENGTH | StepEvent::PEN;
        match self.ring.peek() {
            Some(word) if word as u8 & others == 0 => word >> 8,
            _ => 0,
        }
    }

    /// Raises the pen. The current event was the last.
    #[cold]
    #[inline(never)]
    pub fn stop(&mut self) {
        self.pen.set_height(0);
        self.brake.stop();
        self.ring.set_running(false);
    }

    /// Ends the work because the queue is empty.
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

/// The bits of an event that are levels of the axes' pins.
const LEVELS: u8 = (1 << 5) - 1;

/// The bits of the levels that are pulses and directions.
const STEPS: u8 = StepEvent::STEP_X | StepEvent::STEP_Y | StepEvent::DOWN_X | StepEvent::DOWN_Y;

/// The steps for each combination of these bits: those of x are added in the lower half of a word,
/// those of y in the upper half.
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

/// Adds to a sum. Only its single writer may call this: it is a load and a store, so that a
/// Cortex-M0+ supports it.
#[inline]
fn add(sum: &AtomicU32, more: u32) {
    sum.store(sum.load(Ordering::Relaxed).wrapping_add(more), Ordering::Relaxed);
}
