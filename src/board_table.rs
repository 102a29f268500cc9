//! The table of the boards: one row for each, with everything that a tool or the plotter needs to
//! know about it.
//!
//! The firmware of a board takes its clock, pins and capacities from its row; the build script the
//! feature and the memory map; `xtask` target, profile, budget and checks; `penup` the emulator and
//! what its pins mean. A new board is a new row of [`BOARDS`] and a folder in `src/boards`: see
//! `docs/porting.md`.
//!
//! The file depends on nothing, because the build script includes it.

/// A row of the table: everything that a tool or the plotter needs to know about one board.
#[derive(Debug, PartialEq, Eq)]
pub struct BoardRow {
    /// The name on command lines, of the cargo feature, of the memory map in `boards`, of the image
    /// in `target/firmware`, and in the reply to `$I`.
    pub name: &'static str,
    /// What the board is, for the help of command lines.
    pub about: &'static str,
    /// The compiler's name of the processor for which the firmware is built.
    pub target: &'static str,
    /// The cargo profile with which the firmware is built.
    pub profile: &'static str,
    /// The cargo feature that chooses where the log goes.
    pub log: &'static str,
    /// Whether the linker stores functions with the same instructions once, because flash is short.
    pub folds_functions: bool,
    /// Whether code runs from flash through a cache, so that the handlers of the steps must lie in
    /// RAM, and the functions that `boards/NAME.x` names side by side.
    pub has_flash_cache: bool,
    /// Whether division uses registers that interrupt handlers share with the main loop.
    pub has_shared_divider: bool,
    /// The flash: its address and its size in bytes.
    pub flash: Region,
    /// The size of the second-stage boot loader at the start of flash, in bytes; the vector table
    /// follows. 0 if there is none.
    pub boot_loader: u64,
    /// The RAM: its address and its size in bytes. The stack lies at its start.
    pub ram: Region,
    /// How much flash, RAM and stack an image of the firmware may use.
    pub budget: ImageBudget,
    /// The frequency of the core's clock in hertz.
    pub clock_hertz: u32,
    /// Which pins of the board the machine's motors, pen and switches are connected to.
    pub pins: Pins,
    /// How much memory the plotter gets for models, jobs and moves.
    pub memory: Capacities,
    /// The largest scene that the board must be able to draw.
    pub scene: Scene,
    /// The number of bytes of flash behind the image for a model that is too large for the memory;
    /// 0 if there is none.
    pub model_flash: u64,
    /// The program that emulates the board, and the name by which it knows it.
    pub emulator: Emulator,
    /// How an image gets onto a real board; `None` if the board is emulated only.
    pub flashing: Option<Flashing>,
    /// Whether the pen begins while the order of the strokes is being computed: the cargo feature
    /// `early-ink`.
    pub early_ink: bool,
}

/// A range of memory addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// The first address.
    pub start: u64,
    /// The number of bytes from the first address on.
    pub size: u64,
}

impl Region {
    /// Whether the region contains `size` bytes from `start` on.
    pub const fn holds(self, start: u64, size: u64) -> bool {
        start >= self.start && start + size <= self.start + self.size
    }
}

/// The memory that an image may use, in bytes. A change that needs more raises the limit and gives
/// the reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageBudget {
    /// The most bytes of flash that the image of the firmware may take.
    pub flash: u64,
    /// The most RAM that the image may take beside the stack.
    pub ram: u64,
    /// The least room that must be left for the stack.
    pub stack: u64,
}

/// The numbers of the machine's pins, as the chip counts them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pins {
    /// The step pin of x: each rising edge is one step.
    pub step_x: u8,
    /// The direction pin of x.
    pub dir_x: u8,
    /// The step pin of y: each rising edge is one step.
    pub step_y: u8,
    /// The direction pin of y.
    pub dir_y: u8,
    /// The enable pin of the motor drivers; low switches them on.
    pub enable: u8,
    /// The pin of the servo or the solenoid that moves the pen.
    pub pen: u8,
    /// The step pin of the motor that lifts the pen: each rising edge is one step.
    pub step_z: u8,
    /// The direction pin of that motor; a high level lowers the pen.
    pub dir_z: u8,
    /// The input of the limit switch of x.
    pub limit_x: u8,
    /// The input of the limit switch of y.
    pub limit_y: u8,
    /// The input of the emergency stop.
    pub stop: u8,
}

/// How much the plotter's memory on a board can hold at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacities {
    /// The number of vertices that the model can have.
    pub vertices: usize,
    /// Number of face corners and bar ends of the model.
    pub corners: usize,
    /// Size of the working memory in words of 8 bytes.
    pub words: usize,
    /// The number of serial ports by which commands come: 1 or 2.
    pub ports: usize,
    /// Number of straight moves that are planned ahead.
    pub blocks: usize,
    /// Number of steps that wait for their time on a long path. The machine is never faster than it
    /// could stop within 13/16 of them.
    pub steps: u32,
}

/// A scene, and the size of the drawing that results from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scene {
    /// The number of vertices of the scene, which is the model to be drawn.
    pub vertices: usize,
    /// Number of corners of all faces together.
    pub corners: usize,
    /// Number of faces; each is triangulated as a fan.
    pub faces: usize,
    /// Number of lines of the drawing, with hidden lines erased.
    pub lines: usize,
    /// Number of odd points (of odd degree) of a drawing for which the exact matching must still
    /// fit.
    pub odd_points: usize,
}

/// The program that emulates a board, so that its firmware can be tested without one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Emulator {
    /// The board is emulated by QEMU for Arm.
    Qemu {
        /// The name of the machine that QEMU emulates.
        machine: &'static str,
    },
    /// The board is emulated by the npm package rp2040js, which runs under Node.
    Rp2040js,
}

/// How an image gets onto a real board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flashing {
    /// The name by which probe-rs knows the chip.
    pub chip: &'static str,
    /// The name of the drive that the boot ROM shows.
    pub drive: &'static str,
    /// The number of the chip's family in a UF2 image.
    pub uf2_family: u32,
    /// A part of the name that Linux gives to the USB port of the running firmware.
    pub port: &'static str,
}

/// Texas Instruments LM3S6965 in QEMU. The outputs are those of port B and the contacts those of
/// port C. The linker leaves to the image whatever lies beside the stack.
pub const LM3S6965: BoardRow = BoardRow {
    name: "lm3s6965",
    about: "Texas Instruments LM3S6965: Cortex-M3, 64 KiB of RAM, in QEMU",
    target: "thumbv7m-none-eabi",
    profile: "firmware",
    log: "log-semihosting",
    folds_functions: true,
    has_flash_cache: false,
    has_shared_divider: false,
    flash: Region { start: 0, size: 256 << 10 },
    boot_loader: 0,
    ram: Region { start: 0x2000_0000, size: 64 << 10 },
    budget: ImageBudget { flash: 256 << 10, ram: 55_696, stack: 9_792 },
    clock_hertz: 50_000_000,
    pins: Pins {
        step_x: 0,
        dir_x: 1,
        step_y: 2,
        dir_y: 3,
        enable: 4,
        pen: 5,
        step_z: 6,
        dir_z: 7,
        limit_x: 4,
        limit_y: 5,
        stop: 6,
    },
    // Enough for a lattice of 125 cubes, and for a stack of 9,832 bytes besides.
    memory: Capacities {
        vertices: 1000,
        corners: 3000,
        words: 4208,
        ports: 1,
        blocks: 15,
        steps: 619,
    },
    scene: Scene { vertices: 1000, corners: 3000, faces: 750, lines: 820, odd_points: 400 },
    model_flash: 0,
    emulator: Emulator::Qemu { machine: "lm3s6965evb" },
    flashing: None,
    // The flash of the chip has no room for this feature.
    early_ink: false,
};

/// Raspberry Pi Pico. The log is that of the real board, because the same image is flashed. The
/// budget is all that the memory map (`boards/pico.x`) leaves beside the model in flash, the
/// records and the stack.
pub const PICO: BoardRow = BoardRow {
    name: "pico",
    about: "Raspberry Pi Pico: RP2040, Cortex-M0+, 264 KiB of RAM, in rp2040js",
    target: "thumbv6m-none-eabi",
    profile: "pico",
    log: "log-rtt",
    folds_functions: false,
    has_flash_cache: true,
    has_shared_divider: true,
    flash: Region { start: 0x1000_0000, size: 2 << 20 },
    boot_loader: 256,
    ram: Region { start: 0x2000_0000, size: 264 << 10 },
    budget: ImageBudget { flash: 640 << 10, ram: 252 << 10, stack: 16 << 10 },
    clock_hertz: 125_000_000,
    pins: Pins {
        step_x: 2,
        step_y: 3,
        dir_x: 4,
        dir_y: 5,
        enable: 6,
        pen: 7,
        limit_x: 8,
        limit_y: 9,
        stop: 10,
        step_z: 11,
        dir_z: 12,
    },
    // Enough for a lattice of 343 cubes. The ports are the UART and USB. At 50 mm/s and 200 mm/s²
    // the machine stops within 625 single steps of 0.01 mm. 128 blocks of six hold that, and all
    // that a bend may hide.
    memory: Capacities {
        vertices: 4096,
        corners: 12288,
        words: 16384,
        ports: 2,
        blocks: 128,
        steps: 1776,
    },
    scene: Scene { vertices: 2744, corners: 8232, faces: 2058, lines: 1871, odd_points: 1000 },
    // Enough for 75,000 triangles.
    model_flash: 1120 << 10,
    emulator: Emulator::Rp2040js,
    flashing: Some(Flashing {
        chip: "RP2040",
        drive: "RPI-RP2",
        uf2_family: 0xE48B_FF56,
        port: "penup_pen_plotter",
    }),
    early_ink: true,
};

/// All boards. The first one is the default of command lines.
pub const BOARDS: [&BoardRow; 2] = [&LM3S6965, &PICO];

impl BoardRow {
    /// Returns the row of the board with this name, or `None` if there is none.
    pub fn named(name: &str) -> Option<&'static Self> {
        BOARDS.into_iter().find(|board| board.name == name)
    }
}
