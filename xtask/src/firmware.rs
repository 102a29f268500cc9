//! Builds, checks and measures the firmware image of a board.

mod divider;
mod hot;
mod image;
mod in_ram;

use std::path::{Path, PathBuf};
use std::{fmt, fs};

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, SectionFlags, elf};

use crate::command::run;
use crate::set_up::{self, Toolchain};
use crate::table::{BOARDS, BoardRow, ImageBudget};
use crate::uf2;
use image::Image;

/// The board that `--board` names among the options of another program, or the default board.
///
/// # Errors
/// There is no board of that name.
pub fn board_of(options: &[String]) -> Result<&'static BoardRow> {
    let mut options = options.iter();
    while let Some(option) = options.next() {
        let value = match option.strip_prefix("--board") {
            Some("") => options.next().map(String::as_str),
            Some(rest) => rest.strip_prefix('='),
            None => continue,
        };
        let name = value.context("--board needs a name")?;
        return BoardRow::named(name).with_context(|| {
            let names = BOARDS.map(|board| board.name).join(", ");
            format!("there is no board {name}; there is: {names}")
        });
    }
    Ok(BOARDS[0])
}

/// The options with which cargo builds a board's firmware.
pub fn cargo_options(board: &BoardRow) -> [String; 6] {
    let features = format!("{},{}", board.name, board.log);
    let profile = format!("--profile={}", board.profile);
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

/// The path of a board's image.
fn image_path(board: &BoardRow) -> PathBuf {
    crate::root().join(format!("target/firmware/{}.elf", board.name))
}

/// The path of a board's memory map.
fn memory_map(board: &BoardRow) -> PathBuf {
    crate::root().join(format!("boards/{}.x", board.name))
}

/// Sets up the compiler, builds the firmware, and returns the path of the image. For a board that
/// is flashed by its drive, it also writes the image as UF2.
pub fn build(board: &BoardRow) -> Result<PathBuf> {
    let toolchain = set_up::toolchain(board.target)?;
    let directory = match toolchain {
        Toolchain::Rustup => "target",
        Toolchain::Debian => "target/debian",
    };
    let mut cargo = toolchain.cargo("build", board.target);
    if toolchain == Toolchain::Rustup {
        // The image is then found whatever the user's configuration says.
        cargo.args(["--target-dir", directory]);
    }
    run(cargo.arg("--quiet").args(cargo_options(board)))?;
    let built = Path::new(directory).join(board.target).join(board.profile).join("firmware");
    let image = image_path(board);
    fs::create_dir_all(image.parent().context("the image has a directory")?)?;
    fs::copy(crate::root().join(built), &image)?;
    if let Some(flashing) = board.flashing {
        let uf2 = uf2::of_elf(&fs::read(&image)?, board.flash.start, flashing.uf2_family)?;
        fs::write(image.with_extension("uf2"), uf2)?;
    }
    Ok(image)
}

/// The memory that an image uses on its board, in bytes.
pub struct Sizes {
    board: &'static BoardRow,
    flash: u64,
    ram: u64,
    stack: u64,
    /// The name and size of each section.
    sections: Vec<(String, u64)>,
}

impl Sizes {
    /// Refuses an image that exceeds its budget.
    fn keep_budget(&self) -> Result<()> {
        let ImageBudget { flash, ram, stack } = self.board.budget;
        let name = self.board.name;
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
            writeln!(f, "{}: {size:7} {name}", board.name)?;
        }
        write!(
            f,
            "{}: flash {flash} of {} bytes, RAM {ram} of {} bytes beside a stack of {stack}",
            board.name,
            board.flash.size,
            board.ram.size - stack,
        )
    }
}

/// Checks that the image is linked as the board boots it. The vector table must be where the board
/// looks for it, the stack at the start of RAM, the entry in flash, and every section within the
/// memory. A wrong memory map or missing link arguments cause no linker error, only such an image.
/// Where the row asks for it, this also checks that the step interrupt never waits for flash, that
/// the memory map names functions that exist, and that no handler disturbs a division of the main
/// loop.
///
/// # Errors
/// The image fails a check or exceeds the board's budget.
pub fn check(board: &'static BoardRow, image: &Path) -> Result<Sizes> {
    let bytes = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let elf = object::File::parse(&*bytes)?;
    let (flash, ram) = (board.flash, board.ram);

    let vector_table = flash.start + board.boot_loader;
    let vectors = elf
        .section_by_name(".vector_table")
        .context("the image is empty: the link arguments of build.rs did not arrive")?;
    ensure!(
        vectors.address() == vector_table,
        "the vector table is at {:#010x}, but {} boots from {:#010x}: wrong memory map",
        vectors.address(),
        board.name,
        vector_table
    );
    if board.boot_loader != 0 {
        let boot = elf.section_by_name(".boot2").context("the image lacks the boot loader")?;
        ensure!(
            boot.address() == flash.start && boot.size() == board.boot_loader,
            "the boot loader is not at the start of flash: wrong memory map"
        );
    }
    let code = Image::read(&elf)?;
    if board.has_flash_cache {
        in_ram::check(
            &code,
            ram.start..ram.start + ram.size,
            flash.start..flash.start + flash.size,
        )?;
        hot::check(&elf, &fs::read_to_string(memory_map(board))?)?;
    }
    if board.has_shared_divider {
        divider::check(&code, vectors.data()?)?;
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
        board.name
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
