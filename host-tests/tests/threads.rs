//! Hidden lines on all cores are those of one core, stretch by stretch.

use penup::geometry::Projection;
use penup::model::Elements;
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup::visibility::threads::{self, find_stretches_in_parts};
use penup::visibility::{
    Crease, Options, Report, Scene, SinkFull, Stretch, StretchSink, Unrounded, VisibilityError,
    find_stretches, scratch_bytes,
};
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
        let crease = with_crease.then_some(Crease { cosine: 1 << 14, depth_stretch: (1, 1) });
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
