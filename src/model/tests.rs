//! Tests of building a model: what is sent comes back, and what is refused changes nothing.

use super::*;
fn decimals(texts: [&str; 3]) -> [Decimal; 3] {
    texts.map(|text| Decimal::parse(text).unwrap())
}

fn with_vertices(count: usize, test: impl FnOnce(&mut Model<'_>)) {
    let (mut vertices, mut corners) = ([Position::ORIGIN; 4], [<Corner>::ZERO; 8]);
    let mut model = Model::new(&mut vertices, &mut corners);
    for _ in 0..count {
        model.add_vertex(decimals(["0.25", "-0.5", "0"]), &mut no_undo).unwrap();
    }
    test(&mut model);
}

#[test]
fn a_larger_coordinate_coarsens_the_unit_for_all() {
    with_vertices(1, |model| {
        assert_eq!(model.fraction_bits(), 30);
        model.add_vertex(decimals(["100", "0", "0.1"]), &mut no_undo).unwrap();
        assert_eq!(model.fraction_bits(), 23);
        assert_eq!(model.vertices()[0], Position { x: 1 << 21, y: -(1 << 22), z: 0 });
        assert_eq!(model.vertices()[1].x, 100 << 23);
    });
}

#[test]
fn equal_coordinates_stay_equal_when_the_unit_coarsens() {
    with_vertices(0, |model| {
        let position = ["0.123456789", "-0.7", "0.3"];
        for position in [position, ["9", "0", "0"], ["-700", "0", "0"], position] {
            model.add_vertex(decimals(position), &mut no_undo).unwrap();
        }
        assert_eq!(model.vertices()[0], model.vertices()[3]);
    });
}

#[test]
fn refused_vertices_change_nothing() {
    with_vertices(3, |model| {
        assert_eq!(
            model.add_vertex(decimals(["1e10", "0", "0"]), &mut no_undo),
            Err(ModelError::CoordinateTooLarge)
        );
        assert_eq!((model.vertices().len(), model.fraction_bits()), (3, 30));
        model.add_vertex(decimals(["0", "0", "0"]), &mut no_undo).unwrap();
        assert_eq!(
            model.add_vertex(decimals(["9", "0", "0"]), &mut no_undo),
            Err(ModelError::TooManyVertices { limit: 4 })
        );
        assert_eq!((model.vertices().len(), model.fraction_bits()), (4, 30));
    });
}

#[test]
fn refused_elements_change_nothing() {
    with_vertices(4, |model| {
        let unknown = |number| Err(ModelError::UnknownVertex { number, vertices: 4 });
        for number in [0, 5, -5, i32::MIN, i32::MAX] {
            assert_eq!(model.add_face([1, 2, number].into_iter(), &mut no_undo), unknown(number));
            assert_eq!(model.add_polyline([1, number].into_iter(), &mut no_undo), unknown(number));
        }
        assert_eq!(
            model.add_face([1, 2].into_iter(), &mut no_undo),
            Err(ModelError::TooFewCorners { needed: 3 })
        );
        assert_eq!(
            model.add_polyline([1].into_iter(), &mut no_undo),
            Err(ModelError::TooFewCorners { needed: 2 })
        );
        assert_eq!(
            model.add_face([1, 2, 2].into_iter(), &mut no_undo),
            Err(ModelError::RepeatedVertex { number: 2 })
        );
        assert_eq!(
            model.add_face([1, 2, 3, -4].into_iter(), &mut no_undo),
            Err(ModelError::RepeatedVertex { number: -4 })
        );
        assert_eq!(
            model.add_face([1, 2, 3, 1, 2, 3, 1, 2, 3].into_iter(), &mut no_undo),
            Err(ModelError::TooManyCorners { limit: 8, needed: 9 })
        );
        assert_eq!((model.corner_count(), model.face_count(), model.bar_count()), (0, 0, 0));
    });
}

#[test]
fn elements_come_back_as_they_were_sent() {
    with_vertices(4, |model| {
        model.add_polyline([1, 2, -1].into_iter(), &mut no_undo).unwrap();
        model.add_face([-4, -3, -2, -1].into_iter(), &mut no_undo).unwrap();
        let mut elements = model.elements().iter();
        assert_eq!(elements.next(), Some(Element::Bar(0, 1)));
        assert_eq!(elements.next(), Some(Element::Bar(1, 3)));
        let Some(Element::Face(corners)) = elements.next() else { panic!("a face was sent") };
        assert!(corners.iter().map(|corner| corner.vertex()).eq(0..4));
        assert_eq!(elements.next(), None);
        assert_eq!((model.face_count(), model.bar_count()), (1, 2));
        assert!(!model.is_plan());
    });
}

#[test]
fn bars_at_one_height_are_a_plan() {
    with_vertices(2, |model| {
        assert!(!model.is_plan());
        model.add_polyline([1, 2].into_iter(), &mut no_undo).unwrap();
        assert!(model.is_plan());
        model.add_vertex(decimals(["0", "0", "1"]), &mut no_undo).unwrap();
        assert!(!model.is_plan());
    });
}
