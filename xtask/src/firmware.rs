//! Builds, checks and measures the firmware image of a board.

mod divider;
mod hot;
mod image;
mod in_ram;

use std::path::{Path, PathBuf};
use std::{fmt, fs};

use anyhow::{Context, Result, bail, ensure};
use clap::ValueEnum;
use object::{Object, ObjectSection, SectionFlags, elf};

use crate::command::run;
use crate::set_up::{self, Toolchain};
use crate::uf2;
use image::Image;

/// A board that firmware is built for.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// Texas Instruments LM3S6965 (Cortex-M3), emulated by QEMU.
    #[default]
    Lm3s6965,
    /// Raspberry Pi Pico (RP2040, Cortex-M0+), emulated by rp2040js.
    Pico,
}

/// A range of addresses: its start, and its size in bytes.
#[derive(Clone, Copy)]
struct Region {
    start: u64,
    size: u64,
}

impl Region {
    /// Whether the region contains `size` bytes from `start` on.
    fn holds(self, start: u64, size: u64) -> bool {
        start >= self.start && start + size <= self.start + self.size
    }
}

impl Board {
    /// All boards.
    pub const ALL: &[Self] = &[Self::Lm3s6965, Self::Pico];

    /// The board that `--board` names among the options of another program, or the default board.
    ///
    /// # Errors
    /// There is no board of that name.
    pub fn from_options(options: &[String]) -> Result<Self> {
        let mut options = options.iter();
        while let Some(option) = options.next() {
            let value = match option.strip_prefix("--board") {
                Some("") => options.next().map(String::as_str),
                Some(rest) => rest.strip_prefix('='),
                None => continue,
            };
            let name = value.context("--board needs a name")?;
            return Self::from_str(name, false).map_err(|_| {
                anyhow::anyhow!("there is no board {name}; there is: {}", Self::names())
            });
        }
        Ok(Self::default())
    }

    /// The names of all boards, with commas between them.
    fn names() -> String {
        let names: Vec<_> = Self::ALL.iter().map(|board| board.name()).collect();
        names.join(", ")
    }

    /// The board's name, which is also that of its cargo feature.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lm3s6965 => "lm3s6965",
            Self::Pico => "pico",
        }
    }

    /// The compiler's name of the board's target.
    pub fn target(self) -> &'static str {
        match self {
            Self::Lm3s6965 => "thumbv7m-none-eabi",
            Self::Pico => "thumbv6m-none-eabi",
        }
    }

    /// The cargo profile with which the board's firmware is built.
    fn profile(self) -> &'static str {
        match self {
            Self::Lm3s6965 => "firmware",
            Self::Pico => "pico",
        }
    }

    /// The cargo feature that chooses where the log goes. On the Pico it is the one for the real
    /// board, because the same image is flashed.
    fn log(self) -> &'static str {
        match self {
            Self::Lm3s6965 => "log-semihosting",
            Self::Pico => "log-rtt",
        }
    }

    /// The options with which cargo builds the board's firmware.
    pub fn cargo_options(self) -> [String; 6] {
        let features = format!("{},{}", self.name(), self.log());
        let profile = format!("--profile={}", self.profile());
        [
            "--package=penup",
            "--bin=firmware",
            &profile,
            "--no-default-features",
            "--features",
            &features,
        ]
        .map(str::to_owned)
    }

    /// The path of the image.
    pub fn image(self) -> PathBuf {
        crate::root().join(format!("target/firmware/{}.elf", self.name()))
    }

    /// The board's flash.
    fn flash(self) -> Region {
        match self {
            Self::Lm3s6965 => Region { start: 0, size: 256 << 10 },
            Self::Pico => Region { start: 0x1000_0000, size: 2 << 20 },
        }
    }

    /// The address of the vector table. On the Pico, it follows the boot loader that the boot ROM
    /// runs first.
    fn vectors(self) -> u64 {
        match self {
            Self::Lm3s6965 => self.flash().start,
            Self::Pico => self.flash().start + 256,
        }
    }

    /// The board's RAM.
    fn ram(self) -> Region {
        match self {
            Self::Lm3s6965 => Region { start: 0x2000_0000, size: 64 << 10 },
            Self::Pico => Region { start: 0x2000_0000, size: 264 << 10 },
        }
    }
}

/// Sets up the compiler, builds the firmware, and returns the path of the image. For the Pico, it
/// also writes the image as UF2.
pub fn build(board: Board) -> Result<PathBuf> {
    let toolchain = set_up::toolchain(board.target())?;
    let directory = match toolchain {
        Toolchain::Rustup => "target",
        Toolchain::Debian => "target/debian",
    };
    let mut cargo = toolchain.cargo("build", board.target());
    if toolchain == Toolchain::Rustup {
        // The image is then found whatever the user's configuration says.
        cargo.args(["--target-dir", directory]);
    }
    run(cargo.arg("--quiet").args(board.cargo_options()))?;
    let built = Path::new(directory).join(board.target()).join(board.profile()).join("firmware");
    let image = board.image();
    fs::create_dir_all(image.parent().context("the image has a directory")?)?;
    fs::copy(crate::root().join(built), &image)?;
    if board == Board::Pico {
        let uf2 = uf2::of_elf(&fs::read(&image)?, board.flash().start)?;
        fs::write(image.with_extension("uf2"), uf2)?;
    }
    Ok(image)
}

/// The memory that an image may use on a board, in bytes. A change that needs more raises the limit
/// here and gives the reason.
struct Budget {
    flash: u64,
    ram: u64,
    /// The least size of the stack.
    stack: u64,
}

impl Board {
    fn budget(self) -> Budget {
        match self {
            // All that the linker leaves beside the stack. The linker itself refuses larger images.
            Self::Lm3s6965 => Budget { flash: 256 << 10, ram: 55_696, stack: 9_792 },
            // All that the memory map leaves beside the records and the stack (boards/pico.x).
            Self::Pico => Budget { flash: 1760 << 10, ram: 252 << 10, stack: 12 << 10 },
        }
    }
}

/// The memory that an image uses on its board, in bytes.
pub struct Sizes {
    board: Board,
    flash: u64,
    ram: u64,
    stack: u64,
    /// The name and size of each section.
    sections: Vec<(String, u64)>,
}

impl Sizes {
    /// Refuses an image that exceeds its budget.
    fn keep_budget(&self) -> Result<()> {
        let Budget { flash, ram, stack } = self.board.budget();
        let name = self.board.name();
        ensure!(self.flash <= flash, "{name}: {} bytes of flash, budget {flash}", self.flash);
        ensure!(self.ram <= ram, "{name}: {} bytes of RAM, budget {ram}", self.ram);
        ensure!(self.stack >= stack, "{name}: a stack of {}, budget {stack}", self.stack);
        Ok(())
    }
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { board, flash, ram, stack, sections } = self;
        for (name, size) in sections {
            writeln!(f, "{}: {size:7} {name}", board.name())?;
        }
        write!(
            f,
            "{}: flash {flash} of {} bytes, RAM {ram} of {} bytes beside a stack of {stack}",
            board.name(),
            board.flash().size,
            board.ram().size - stack,
        )
    }
}

/// Checks that the image is linked as the board boots it. The vector table must be where the board
/// looks for it, the stack at the start of RAM, the entry in flash, and every section within the
/// memory. A wrong memory map or missing link arguments cause no linker error, only such an image.
/// For the Pico, this also checks that the step interrupt never waits for flash, that no handler
/// disturbs a division of the main loop, and that `boards/pico.x` names functions that exist.
///
/// # Errors
/// The image fails a check or exceeds the board's budget.
pub fn check(board: Board, image: &Path) -> Result<Sizes> {
    let bytes = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let elf = object::File::parse(&*bytes)?;
    let (flash, ram) = (board.flash(), board.ram());

    let vectors = elf
        .section_by_name(".vector_table")
        .context("the image is empty: the link arguments of build.rs did not arrive")?;
    ensure!(
        vectors.address() == board.vectors(),
        "the vector table is at {:#010x}, but {} boots from {:#010x}: wrong memory map",
        vectors.address(),
        board.name(),
        board.vectors()
    );
    if board == Board::Pico {
        let boot = elf.section_by_name(".boot2").context("the image lacks the boot loader")?;
        ensure!(
            boot.address() == flash.start && boot.size() == 256,
            "the boot loader is not at the start of flash: wrong memory map"
        );
        let code = Image::read(&elf)?;
        in_ram::check(
            &code,
            ram.start..ram.start + ram.size,
            flash.start..flash.start + flash.size,
        )?;
        divider::check(&code, vectors.data()?)?;
        hot::check(&elf, &fs::read_to_string(crate::root().join("boards/pico.x"))?)?;
    }
    let table = vectors.data()?;
    let word = |index: usize| -> Result<u64> {
        let bytes = table.get(4 * index..4 * index + 4).context("the vector table is cut off")?;
        Ok(u64::from(u32::from_le_bytes(bytes.try_into()?)))
    };
    // The stack lies at the start of RAM, so that an overflow causes a fault.
    let (stack, entry) = (word(0)?, word(1)?);
    ensure!(
        stack > ram.start && stack < ram.start + ram.size,
        "the stack begins at {stack:#010x}, not within {}'s RAM",
        board.name()
    );
    ensure!(
        entry % 2 == 1 && flash.holds(entry - 1, 2),
        "the entry {entry:#010x} is no code in flash"
    );

    let mut sizes =
        Sizes { board, flash: 0, ram: 0, stack: stack - ram.start, sections: Vec::new() };
    for section in elf.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else {
            continue;
        };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 || section.size() == 0 {
            continue;
        }
        let (start, size) = (section.address(), section.size());
        // The strings of the log are not part of the image; they stay on the host.
        if section.name()? == ".defmt" {
            continue;
        }
        sizes.sections.push((section.name()?.to_owned(), size));
        if flash.holds(start, size) {
            sizes.flash += size;
        } else if ram.holds(start, size) {
            sizes.ram += size;
            // Initial values are copied from flash, so they take space there, too.
            if section.file_range().is_some() {
                sizes.flash += size;
            }
        } else {
            bail!("section {} at {start:#010x} is outside the memory", section.name()?);
        }
    }
    sizes.keep_budget()?;
    Ok(sizes)
}
