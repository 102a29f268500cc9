use super::*;

/// Without a limit in bends.
fn limits() -> Limits {
    Limits { centripetal: false, ..Limits::default() }
}

fn block(length: u32, entry_limit: u32) -> Block {
    Block {
        length: PathLength::from_bits(length),
        entry_limit: PathLength::from_bits(entry_limit),
        ..Block::EMPTY
    }
}

#[test]
fn a_full_ring_hands_the_block_back_and_keeps_the_order() {
    let mut memory = [Block::EMPTY; 3];
    let mut ring = Lookahead::new(&mut memory);
    for round in 0..5u32 {
        for k in 0..3 {
            assert_eq!(ring.push(block(round * 3 + k, 0)), Ok(()));
        }
        assert_eq!(ring.push(block(99, 0)), Err(block(99, 0)));
        for k in 0..3 {
            assert_eq!(ring.pop(Block::clone), Some(block(round * 3 + k, 0)));
        }
        assert_eq!(ring.pop(Block::clone), None);
        ring.push(block(0, 0)).expect("room");
        ring.pop(Block::clone);
    }
    let mut none = Lookahead::new(&mut []);
    assert!(none.push(block(1, 1)).is_err());
    assert_eq!(none.pop(Block::clone), None);
    assert_eq!(none.entry_allowed(PathLength::MAX, &limits()), PathLength::ZERO);
}

#[test]
fn the_nearest_binding_limit_counts() {
    let mut memory = [Block::EMPTY; 4];
    let mut ring = Lookahead::new(&mut memory);
    let allowed =
        |ring: &Lookahead, top| ring.entry_allowed(PathLength::from_bits(top), &limits()).to_bits();
    ring.push(block(100, 1000)).expect("room");
    assert_eq!(allowed(&ring, 5000), 100);
    ring.push(block(300, 20)).expect("room");
    assert_eq!(allowed(&ring, 5000), 120);
    assert_eq!(allowed(&ring, 50), 50);
    ring.push(block(300, 1000)).expect("room");
    ring.pop(Block::clone);
    assert_eq!(allowed(&ring, 5000), 20);
}

#[test]
fn the_lowest_limit_is_known() {
    let mut memory = [Block::EMPTY; 7];
    let mut ring = Lookahead::new(&mut memory);
    ring.pass_limits_on(false);
    for round in 0..300u32 {
        if ring.is_full() || round % 13 > 9 {
            ring.pop(Block::clone);
        }
        ring.push(block(10, 20 + round * 7 % 31)).expect("room");
        if round % 11 == 0 {
            ring.limit_curve(2, 4, PathLength::from_bits(round * 5 % 37));
        }
        let lowest = ring.blocks().concat().iter().map(Block::limit).min();
        assert_eq!(Some(ring.lowest_limit()), lowest, "{round}");
    }
    ring.clear();
    assert_eq!(ring.lowest_limit(), PathLength::MAX);
}

#[test]
fn what_a_block_allows_is_known_to_all_before_it() {
    let mut memory = [Block::EMPTY; 7];
    let mut ring = Lookahead::new(&mut memory);
    for round in 0..200u32 {
        if ring.is_full() {
            ring.pop(Block::clone);
        }
        let limit = if round % 5 == 0 { round % 70 } else { 5000 };
        ring.push(block(10 + round * 7 % 90, limit)).expect("room");
        if round % 11 == 0 {
            ring.limit_curve(2, 4, PathLength::from_bits(30 + round));
        }
        // Each block by itself, from the end on.
        let blocks: std::vec::Vec<_> = ring.blocks().concat();
        let mut allowed = 0;
        for block in blocks.iter().rev() {
            let limit = block.entry_limit.min(block.curve_limit).to_bits();
            allowed = limit.min(allowed + block.length.to_bits());
        }
        assert_eq!(ring.entry_allowed(PathLength::MAX, &limits()).to_bits(), allowed, "{round}");
    }
}

#[test]
fn short_moves_are_joined_where_the_blocks_are_few() {
    // 0.5 mm are 131072 units.
    let limits = limits();
    let mut memory = [Block::EMPTY; 4];
    let mut ring = Lookahead::new(&mut memory);
    let line = |dx, dy, length| Block { dx, dy, ..block(length, u32::MAX) };
    let mut sum = 0;
    for number in 0..19u32 {
        let line = line(3, (number % 2) as i32, 700 + number);
        sum += 700 + u64::from(number);
        if !ring.join(&line, false, &limits) {
            ring.push(line).expect("room");
        }
    }
    assert_eq!(ring.known(), sum << 14);
    let counts: std::vec::Vec<_> =
        ring.blocks().concat().iter().map(|block| block.chords().len()).collect();
    // Half of the memory is filled first.
    assert_eq!(counts, [0, 5, 5, 5]);
    let (gap, dash) = (BlockKind::Gap, Some(LineType::Dashed));
    for other in [
        Block { kind: gap, ..line(1, 0, 9) },
        Block { ink: dash, ..line(1, 0, 9) },
        Block { offsets: [1, 0], ..line(1, 0, 9) },
        Block { ink: Some(LineType::Full), ..line(1, 0, 9) },
        line(1, 0, 9),
    ] {
        assert!(!ring.join(&other, false, &limits), "{other:?}");
    }
    // Moves in line take no room in a block.
    ring.clear();
    for _ in 0..2 {
        ring.push(line(2, 1, 50)).expect("room");
    }
    for _ in 0..100 {
        assert!(ring.join(&line(4, 2, 100), false, &limits));
    }
    let last = *ring.blocks()[0].last().expect("a block");
    assert_eq!((last.dx, last.dy, last.chords().len()), (402, 201, 0));
    assert!(ring.join(&line(-4, -2, 100), false, &limits));
    let last = *ring.blocks()[0].last().expect("a block");
    assert_eq!((last.dx, last.dy, last.chords().len()), (402, 201, 1));
}

#[test]
fn short_moves_in_line_are_one_block_up_to_a_length_that_rounding_explains() {
    let limits = limits();
    let most = 16 * limits.rounding.to_bits();
    let mut memory = [Block::EMPTY; 64];
    let mut ring = Lookahead::new(&mut memory);
    let line = |dx, dy, length| Block { dx, dy, ..block(length, u32::MAX) };
    let mut push = |line: Block, goes_on| {
        let is_joined = ring.join(&line, goes_on, &limits);
        if !is_joined {
            ring.push(line).expect("room");
        }
        let last = *ring.blocks()[0].last().expect("a block");
        (is_joined, [last.dx, last.dy], last.points)
    };
    assert_eq!(push(line(5, 1, 5000), false), (false, [5, 1], 1));
    assert_eq!(push(line(5, 1, 5000), true), (true, [10, 2], 2));
    assert_eq!(push(line(10, 2, 10_000), true), (true, [20, 4], 3));
    // The motors do not go on in this direction, although the pen does.
    assert_eq!(push(line(5, 2, 5000), true), (false, [5, 2], 1));
    assert_eq!(push(line(-5, -2, 5000), true), (false, [-5, -2], 1));
    // The block is as long as may be before the next move.
    assert_eq!(push(line(3, 0, most), true), (false, [3, 0], 1));
    assert_eq!(push(line(3, 0, most), true), (false, [3, 0], 1));
    assert_eq!(ring.known(), u64::from(30_000 + 2 * most) << 14);
}

#[test]
fn bends_that_are_not_known_yet_are_allowed_for() {
    let limits = Limits { centripetal: true, ..limits() };
    let mut memory = [Block::EMPTY; 4];
    let mut ring = Lookahead::new(&mut memory);
    ring.push(block(1 << 30, u32::MAX)).expect("room");
    let known = u64::from(limits.surely_known);
    let mut before = 0;
    for to_end in 0..known {
        let allowed = ring.stopping_distance_at(to_end, &limits);
        assert!(allowed <= to_end && (before..=before + 1).contains(&allowed), "{to_end}");
        before = allowed;
    }
    assert_eq!(before, known - 1 - known / 4);
    ring.end_curve();
    assert_eq!(ring.stopping_distance_at(known, &limits), known);
}
