//! Hidden lines on all cores are those of one core, stretch by stretch, and so is the order.

use penup::drawing::{Drawing, Segment};
use penup::geometry::Projection;
use penup::index::Index;
use penup::model::Elements;
use penup::order::{self, Effort, FirstStrokes, Leg, OrderError, Shape, TimeModel};
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup::visibility::threads::{self, find_stretches_in_parts};
use penup::visibility::{
    Crease, Options, Report, Scene, SinkFull, Stretch, StretchSink, Unrounded, VisibilityError,
    find_stretches, scratch_bytes,
};
use penup_host_tests::order_drawings::{KINDS, Strokes, random};
use penup_host_tests::random_scenes::random_scene;
use penup_host_tests::scene_files::{Model, Stretches, View};
use proptest::prelude::*;

/// Cancels the search when it has been asked so many times.
struct CancelAfter(usize);

impl Cancel for CancelAfter {
    fn check(&mut self) -> Result<(), Aborted> {
        self.0 = self.0.checked_sub(1).ok_or(Aborted)?;
        Ok(())
    }
}

/// Has room for so many stretches.
struct Room(usize);

impl StretchSink for Room {
    fn stretch(&mut self, _: Stretch) -> Result<(), SinkFull> {
        self.0 = self.0.checked_sub(1).ok_or(SinkFull)?;
        Ok(())
    }
}

/// Runs the search in parts of `part` corners, or on one core if there are none.
fn search(
    scene: &Scene<'_>,
    options: Options,
    part: Option<usize>,
    (cancel, sink): (&mut dyn Cancel, &mut dyn StretchSink),
) -> Result<Report, VisibilityError> {
    let mut words = vec![0u64; 2 * scratch_bytes(scene) / 8];
    let scratch = Scratch::new(&mut words);
    match part {
        Some(part) => find_stretches_in_parts(part, scene, options, scratch, cancel, sink),
        None => find_stretches(scene, options, scratch, cancel, sink),
    }
}

proptest! {
    #[test]
    fn parts_of_any_size_change_nothing(
        seed in any::<u64>(),
        [with_hidden, with_seams, merged_blocks, with_crease] in any::<[bool; 4]>(),
        part in 0usize..64,
    ) {
        let random = random_scene(seed);
        let half = Crease { cosine: 1 << 19, depth_stretch: (1, 1), slants: [0; 2] };
        let crease = with_crease.then_some(half);
        let options = Options { with_hidden, with_seams, merged_blocks, crease };
        let scene = Scene {
            vertices: &random.vertices,
            elements: Elements::new(&random.corners),
            projection: random.projection,
            unrounded: Unrounded::UNKNOWN,
        };
        let [mut one, mut all] = [Stretches(Vec::new()), Stretches(Vec::new())];
        let known = search(&scene, options, None, (&mut NeverCancel, &mut one));
        let found = search(&scene, options, Some(part), (&mut NeverCancel, &mut all));
        prop_assert_eq!(known, found);
        prop_assert_eq!(one.0, all.0);
    }
}

/// A torus that is large enough to be divided.
fn torus() -> (Model, View) {
    let model = Model::torus(60, 50);
    let (eye, at, up) = ([6.0, -7.0, 5.0], [0.0; 3], [0.0, 0.0, 1.0]);
    let view = View::new(&model, eye, at, up, Projection::Perspective);
    (model, view)
}

/// What is seen of a model.
fn scene_of<'s>(model: &'s Model, view: &'s View) -> Scene<'s> {
    Scene {
        vertices: &view.vertices,
        elements: Elements::new(&model.corners),
        projection: view.projection,
        unrounded: Unrounded::UNKNOWN,
    }
}

#[test]
fn a_large_mesh_is_the_same_on_all_cores() {
    let (model, view) = torus();
    let scene = scene_of(&model, &view);
    let options = Options { with_hidden: true, with_seams: true, ..Options::default() };
    let [mut one, mut all] = [Stretches(Vec::new()), Stretches(Vec::new())];
    let known = search(&scene, options, None, (&mut NeverCancel, &mut one));
    let mut words = vec![0u64; 2 * scratch_bytes(&scene) / 8];
    let scratch = Scratch::new(&mut words);
    let found = threads::find_stretches(&scene, options, scratch, &mut NeverCancel, &mut all);
    assert_eq!(known, found);
    assert!(one.0.len() > 3000 && one.0 == all.0);
}

#[test]
fn it_ends_when_it_is_cancelled_or_the_sink_is_full() {
    let (model, view) = torus();
    let scene = scene_of(&model, &view);
    let part = Some(100);
    let mut all = Stretches(Vec::new());
    search(&scene, Options::default(), None, (&mut NeverCancel, &mut all)).unwrap();
    let count = all.0.len();
    for room in [0, 1, count / 2, count - 1] {
        let found = search(&scene, Options::default(), part, (&mut NeverCancel, &mut Room(room)));
        assert_eq!(found, Err(VisibilityError::SinkFull));
    }
    let mut room = Room(count);
    assert!(search(&scene, Options::default(), part, (&mut NeverCancel, &mut room)).is_ok());
    // The last of these is while the parts are handed over.
    for checks in [0, 3, 20] {
        let sinks = (&mut CancelAfter(checks) as &mut dyn Cancel, &mut Room(count) as _);
        let found = search(&scene, Options::default(), part, sinks);
        assert_eq!(found, Err(VisibilityError::Aborted));
    }
}

#[test]
fn what_is_refused_on_one_core_is_refused_on_all() {
    let (model, view) = torus();
    let mut scene = scene_of(&model, &view);
    scene.vertices = &scene.vertices[..100];
    let part = Some(100);
    let known = search(&scene, Options::default(), None, (&mut NeverCancel, &mut Room(0)));
    let found = search(&scene, Options::default(), part, (&mut NeverCancel, &mut Room(0)));
    assert!(matches!(known, Err(VisibilityError::UnknownVertex(_))));
    assert_eq!(known, found);
}

/// The options with which a computer orders for a plotter.
fn by_a_computer(shape: Shape) -> order::Options {
    let time_model = TimeModel { units_per_second: TimeModel::COMPUTER, ..TimeModel::default() };
    let effort = Effort::Auto(time_model);
    order::Options { effort, shape, lift_cost: 2 * 80 * 256, ..order::Options::default() }
}

/// Orders the strokes behind the first `drawn`, with numbers of this width. Returns the segments
/// and directions of the tour.
fn order_with<I: Index>(
    strokes: &Strokes,
    drawn: usize,
    options: order::Options,
    cancel: &mut dyn Cancel,
) -> Result<(Vec<(usize, bool)>, order::Report), OrderError> {
    let number = |number: u32| I::new(number as usize);
    let segment =
        |segment: &Segment<u32>| Segment::new(number(segment.from()), number(segment.to()));
    let segments: Vec<Segment<I>> = strokes.segments.iter().map(segment).collect();
    let drawing = Drawing { points: &strokes.points, segments: &segments };
    let mut memory = vec![0; 64 * segments.len() + 8192];
    let mut tour = vec![Leg::new(I::ZERO, false); segments.len()];
    let scratch = Scratch::new(&mut memory);
    let report = if drawn == 0 {
        order::order(drawing, options, scratch, cancel, &mut tour)?
    } else {
        let first = FirstStrokes { segments: drawn, ..FirstStrokes::default() };
        order::first_legs(&mut tour[..drawn]);
        let (drawn, rest) = tour.split_at_mut(drawn);
        order::order_rest(drawing, first, drawn, options, scratch, cancel, rest)?
    };
    Ok((tour.iter().map(|leg| (leg.segment(), leg.reversed())).collect(), report))
}

#[test]
fn the_order_depends_neither_on_the_cores_nor_on_the_width_of_its_numbers() {
    let pools = [1, 2, 5].map(|threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("some threads")
    });
    for ((name, make), seed) in KINDS.into_iter().zip(1..) {
        for (shape, drawn) in [(Shape::OpenPath, 0), (Shape::ClosedCycle, 0), (Shape::OpenPath, 20)]
        {
            let strokes = &make(900, seed);
            let options = by_a_computer(shape);
            let order = || order_with::<u32>(strokes, drawn, options, &mut NeverCancel);
            let expected = order().expect("an order");
            for pool in &pools {
                assert!(pool.install(order).expect("an order") == expected, "{name} {shape:?}");
            }
            let narrow = order_with::<u16>(strokes, drawn, options, &mut NeverCancel);
            assert!(narrow.expect("an order") == expected, "{name} {shape:?}, numbers of 16 bits");
            let mut segments: Vec<_> = expected.0.iter().map(|&(segment, _)| segment).collect();
            segments.sort_unstable();
            assert!(segments.into_iter().eq(0..strokes.segments.len()), "{name} {shape:?}");
        }
    }
}

#[test]
fn all_cores_find_what_one_core_finds_and_a_board_does_not() {
    for (count, drawn) in [(800, 0), (1300, 0), (3300, 0), (900, 10)] {
        for shape in [Shape::OpenPath, Shape::ClosedCycle] {
            let strokes = &random(count, count);
            let options = by_a_computer(shape);
            let pen_up = |options| {
                let order = order_with::<u32>(strokes, drawn, options, &mut NeverCancel);
                order.expect("an order").1.pen_up
            };
            let with = |effort| pen_up(order::Options { effort, ..options });
            let [all_cores, board] = [options.effort, Effort::default()].map(with);
            // One core has the same units for each move, all at once.
            let one_core = with(Effort::Units(10_000));
            let table = format!("{count} {shape:?}: {all_cores}, {board}, {one_core}");
            println!("{table}");
            assert!(all_cores < board / 100 * 99, "{table}");
            assert!(all_cores < one_core / 100 * 101, "{table}");
        }
    }
}

#[test]
fn an_order_on_all_cores_can_be_cancelled() {
    let strokes = &random(900, 1);
    let options = by_a_computer(Shape::OpenPath);
    let mut all = CancelAfter(usize::MAX);
    order_with::<u32>(strokes, 0, options, &mut all).expect("an order");
    let asked = usize::MAX - all.0;
    for part in 0..16 {
        let mut cancel = CancelAfter(asked * part / 16);
        let order = order_with::<u32>(strokes, 0, options, &mut cancel);
        assert_eq!(order.err(), Some(OrderError::Aborted), "after {part} of 16 parts");
    }
}
