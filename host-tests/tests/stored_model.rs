//! A model that is written to flash while it arrives is the model that memory would hold, whenever
//! the power fails either there is none or all of it, and what does not fit is refused by name.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use penup::boards::host::CutArea;
use penup::fixed::Decimal;
use penup::model::{
    Corner, Element, Model, ModelError, PenName, Position, Positions, StoredModel, Upload,
    UploadError, no_undo,
};
use penup::storage::area::SECTOR_BYTES;
use penup_host_tests::random::Random;

/// A line that adds to a model.
#[derive(Debug, Clone)]
enum Line {
    Vertex([String; 3]),
    Face(Vec<i32>),
    Polyline(Vec<i32>),
    Pen(bool, PenName),
}

/// Lines at random, some of which are refused.
fn lines(seed: u64, count: usize) -> Vec<Line> {
    let mut random = Random::new(seed);
    let mut vertices = 0;
    (0..count)
        .map(|_| {
            let numbers = |random: &mut Random| {
                let length = random.below(5) as usize + 2;
                let number = |random: &mut Random| match random.below(9) {
                    0 => -(random.below(4) as i32) - 1,
                    1 => random.below(vertices as u64 + 2) as i32,
                    _ => random.below(vertices as u64 + 1) as i32 + 1,
                };
                (0..length).map(|_| number(random)).collect()
            };
            match random.below(10) {
                0..4 => {
                    vertices += 1;
                    let digits = random.below(5);
                    let mut coordinate = || {
                        let size = 10i64.pow(random.below(3 + digits) as u32);
                        let whole = random.below(2 * size as u64 + 1) as i64 - size;
                        format!("{whole}.{}", random.below(10_000))
                    };
                    Line::Vertex([coordinate(), coordinate(), coordinate()])
                }
                4 => Line::Polyline(numbers(&mut random)),
                5 if random.once_in(3) => {
                    let name = match random.below(2) {
                        0 => PenName::Number(random.below(33) as u8),
                        _ => PenName::Other(random.below(20) as u32 + 100),
                    };
                    Line::Pen(random.once_in(4), name)
                }
                _ => Line::Face(numbers(&mut random)),
            }
        })
        .collect()
}

fn decimals(texts: &[String; 3]) -> [Decimal; 3] {
    texts.each_ref().map(|text| Decimal::parse(text).unwrap())
}

/// Adds a line to a model in memory.
fn add(model: &mut Model<'_, u32>, line: &Line) -> Result<(), ModelError> {
    match line {
        Line::Vertex(texts) => model.add_vertex(decimals(texts), &mut no_undo),
        Line::Face(numbers) => model.add_face(numbers.iter().copied(), &mut no_undo),
        Line::Polyline(numbers) => model.add_polyline(numbers.iter().copied(), &mut no_undo),
        Line::Pen(by_material, name) => model.choose_pen(*by_material, *name, &mut no_undo),
    }
}

/// Adds a line to a model in flash.
fn write(upload: &mut Upload, line: &Line, flash: &mut CutArea) -> Result<(), UploadError> {
    let area = flash.area();
    match line {
        Line::Vertex(texts) => upload.add_vertex(decimals(texts), area, flash),
        Line::Face(numbers) => upload.add_face(numbers.iter().copied(), area, flash),
        Line::Polyline(numbers) => upload.add_polyline(numbers.iter().copied(), area, flash),
        Line::Pen(by_material, name) => upload.choose_pen(*by_material, *name),
    }
}

fn with_memory<R>(test: impl FnOnce(&mut Model<'_, u32>) -> R) -> R {
    let (mut vertices, mut corners) =
        (vec![Position::ORIGIN; 4000], vec![Corner::<u32>::ZERO; 30_000]);
    test(&mut Model::new(&mut vertices, &mut corners))
}

/// Writes all lines, of which the first ones were in memory before.
fn upload(lines: &[Line], in_memory: usize, flash: &mut CutArea) -> Result<(), UploadError> {
    let area = flash.area();
    let mut upload = with_memory(|model| {
        for line in &lines[..in_memory] {
            let _ = add(model, line);
        }
        Upload::begin(model, area, flash)
    })?;
    for line in &lines[in_memory..] {
        match write(&mut upload, line, flash) {
            Err(UploadError::Flash) => return Err(UploadError::Flash),
            Ok(()) | Err(UploadError::Model(_)) => {}
        }
    }
    upload.finish(area, flash)?;
    Ok(())
}

fn is_sound(stored: &StoredModel<'_>) -> bool {
    stored.is_sound::<()>(&mut || Ok(())).unwrap()
}

#[test]
fn a_model_in_flash_is_the_one_in_memory() {
    let mut coarsened = 0;
    for seed in 0..200 {
        let lines = lines(seed, 20 + 3 * seed as usize);
        let in_memory = Random::new(!seed).below(lines.len() as u64) as usize;
        let mut flash = CutArea::new(16 * SECTOR_BYTES);
        let area = flash.area();
        with_memory(|model| {
            for line in &lines[..in_memory] {
                let _ = add(model, line);
            }
            let mut upload = Upload::begin(model, area, &mut flash).unwrap();
            for line in &lines[in_memory..] {
                let (refused, also) = (add(model, line), write(&mut upload, line, &mut flash));
                assert_eq!(refused.map_err(UploadError::Model), also, "{line:?}");
            }
            let stored = upload.finish(area, &mut flash).unwrap();
            assert!(is_sound(&stored), "seed {seed}");
            assert_eq!(stored.fraction_bits(), model.fraction_bits(), "seed {seed}");
            assert_eq!(Positions::bounds(&stored), Model::bounds(model), "seed {seed}");
            assert_eq!(Positions::precision(&stored), Model::precision(model), "seed {seed}");
            assert_eq!(stored.positions().collect::<Vec<_>>(), model.vertices(), "seed {seed}");
            assert_eq!(stored.face_count(), model.face_count());
            assert_eq!(stored.bar_count(), model.bar_count());
            assert_eq!(stored.is_plan(), model.is_plan());
            let corners = model.elements().corners();
            assert_eq!(stored.corner_count(), corners.len());
            let mut pens = 0u32;
            let mut first = 0;
            for (element, pen) in model.elements().iter_with_pens() {
                pens |= 1 << pen;
                let count = element.corner_count();
                for (number, corner) in corners.iter().enumerate().skip(first).take(count) {
                    assert_eq!(stored.corner(number), *corner);
                    assert_eq!(stored.pen(number), pen, "seed {seed}, corner {number}");
                }
                first += element.corner_count();
                let _: Element<'_, u32> = element;
            }
            // A pen whose elements have lost it may still be among them.
            assert_eq!(stored.pens() & pens, pens, "seed {seed}");
            assert_eq!(stored.checksum(), model.checksum(), "seed {seed}");
            coarsened += usize::from(stored.fraction_bits() < 20);
        });
    }
    assert!(coarsened > 50, "{coarsened}");
}

/// The checksum of the model that the flash holds, whose contents must be sound.
fn held(flash: &CutArea) -> Option<u32> {
    let stored = StoredModel::new(flash.area())?;
    assert!(is_sound(&stored));
    Some(stored.checksum())
}

#[test]
fn a_loss_of_power_leaves_no_model_or_a_whole_one() {
    let (old, new) = (lines(1, 300), lines(2, 500));
    let begun = || {
        let mut flash = CutArea::new(6 * SECTOR_BYTES);
        upload(&old, 100, &mut flash).unwrap();
        flash
    };
    let mut whole = begun();
    let before = held(&whole);
    let (erased, written) = (whole.erasures.iter().sum::<u32>(), whole.pages);
    upload(&new, 200, &mut whole).unwrap();
    let after = held(&whole);
    assert!(before.is_some() && after.is_some() && before != after);
    let erased = (whole.erasures.iter().sum::<u32>() - erased) as usize * SECTOR_BYTES;
    let bytes = erased + (whole.pages - written) * 256;
    // Before every byte of the record, around every page, and every 97 bytes.
    let budgets = (0..bytes).filter(|at| {
        at + 300 > bytes || *at < 20 || matches!(at % 256, 0 | 1 | 255) || at % 97 == 0
    });
    let mut outcomes = [0; 3];
    for budget in budgets {
        let mut flash = begun();
        flash.budget = budget;
        assert_eq!(upload(&new, 200, &mut flash), Err(UploadError::Flash), "{budget} of {bytes}");
        let found = held(&flash);
        outcomes[match found {
            None => 0,
            found if found == before => 1,
            found if found == after => 2,
            _ => panic!("a mixture after {budget} of {bytes} bytes"),
        }] += 1;
        // Whatever is left, the next model takes its place.
        flash.budget = usize::MAX;
        upload(&new, 200, &mut flash).unwrap();
        assert_eq!(held(&flash), after);
    }
    assert!(outcomes[0] > 200 && outcomes[1] > 0, "{outcomes:?}");
}

#[test]
fn removing_a_model_erases_nothing_and_survives_a_loss_of_power() {
    let lines = lines(3, 200);
    for budget in 0..=256 {
        let mut flash = CutArea::new(4 * SECTOR_BYTES);
        upload(&lines, 0, &mut flash).unwrap();
        let (before, erasures) = (held(&flash), flash.erasures.clone());
        flash.budget = budget;
        let outcome = flash.area().clear(&mut flash);
        assert_eq!(flash.erasures, erasures);
        match held(&flash) {
            None => assert!(budget > 0),
            found => assert!(outcome.is_err() && found == before),
        }
        assert_eq!(outcome.is_ok(), budget == 256);
        flash.budget = usize::MAX;
        flash.area().clear(&mut flash).unwrap();
        assert_eq!(held(&flash), None);
    }
}

#[test]
fn garbage_is_no_model_and_damage_is_found() {
    let lines = lines(4, 400);
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let mut flash = CutArea::new(6 * SECTOR_BYTES);
        for at in 0..6 * SECTOR_BYTES {
            flash.set_byte(at, random.below(256) as u8);
        }
        assert!(StoredModel::new(flash.area()).is_none());
        upload(&lines, 50, &mut flash).unwrap();
        let stored = StoredModel::new(flash.area()).unwrap();
        let (low, high) = (12 * stored.vertex_count(), 3 * stored.corner_count());
        // Any bit of the record, or of the contents.
        let end = flash.area().bytes();
        let at = match random.below(3) {
            0 => random.below(256) as usize,
            1 => 256 + random.below(low as u64) as usize,
            _ => end - 1 - random.below(high as u64) as usize,
        };
        let before = flash.bytes()[at];
        flash.set_byte(at, before ^ 1 << random.below(8));
        match StoredModel::new(flash.area()) {
            None => assert!(at < 256),
            Some(stored) => assert!(at >= 256 && !is_sound(&stored), "byte {at}"),
        }
        // Whatever the corners say, reading them does no harm.
        if let Some(stored) = StoredModel::new(flash.area()) {
            (0..stored.corner_count() + 9).for_each(|corner| {
                let vertex = stored.corner(corner).vertex();
                let _ = (stored.position(vertex as usize), stored.pen(corner));
            });
        }
    }
}

#[test]
fn a_full_flash_says_how_much_it_holds() {
    for (seed, share) in [(1, 0), (2, 1), (3, 5), (4, 100)] {
        let mut random = Random::new(seed);
        let mut flash = CutArea::new(3 * SECTOR_BYTES);
        let area = flash.area();
        with_memory(|model| {
            let mut upload = Upload::begin(model, area, &mut flash).unwrap();
            for _ in 0..4 {
                let line = Line::Vertex([(); 3].map(|()| random.below(1000).to_string()));
                add(model, &line).unwrap();
                write(&mut upload, &line, &mut flash).unwrap();
            }
            let mut refused = [None; 2];
            while refused != [Some(()); 2] {
                let is_vertex = random.below(101) >= share;
                let line = if is_vertex {
                    Line::Vertex([(); 3].map(|()| random.below(1000).to_string()))
                } else {
                    Line::Face(vec![1, 2, 3, 4])
                };
                let (vertices, corners) =
                    (model.vertices().len(), model.elements().corners().len());
                match write(&mut upload, &line, &mut flash) {
                    Ok(()) => add(model, &line).unwrap(),
                    Err(error) => {
                        let full = ModelError::StoreFull { vertices, corners };
                        assert_eq!(error, UploadError::Model(full));
                        refused[usize::from(is_vertex)] = Some(());
                        if share == 0 || share == 100 {
                            break;
                        }
                    }
                }
            }
            let bytes = 12 * model.vertices().len() + 3 * model.elements().corners().len();
            assert!(bytes > 3 * SECTOR_BYTES - 4 * 256, "{bytes}");
            let stored = upload.finish(area, &mut flash).unwrap();
            assert!(is_sound(&stored));
            assert_eq!(stored.checksum(), model.checksum());
            assert!(flash.erasures.iter().all(|&erasures| erasures <= 2), "{:?}", flash.erasures);
        });
    }
    let mut flash = CutArea::new(0);
    let begun = with_memory(|model| Upload::begin(model, flash.area(), &mut flash).map(|_| ()));
    assert!(matches!(begun, Err(UploadError::Model(ModelError::StoreFull { .. }))));
}
