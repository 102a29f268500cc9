//! Cuts lines into the dashes of their line type.

use crate::plan::Point;

/// The most dashes of a line.
const MOST_DASHES: f64 = 20_000.0;

/// The length in mm at the end of a side that is left out, because rounding made it.
const ROUNDING: f64 = 1e-6;

/// The dashes of a line: those with a length above 0 are drawn, those below 0 are gaps, and 0 is a
/// dot, a piece of one point. A line that is shorter than its dashes and gaps together is drawn as
/// a whole, and so is one of too many dashes; `None` is returned for the latter.
pub(super) fn dashed(points: Vec<Point>, lengths: &[f64]) -> Option<Vec<Vec<Point>>> {
    let period: f64 = lengths.iter().map(|length| length.abs()).sum();
    let sides = || points.iter().zip(points.iter().skip(1));
    let length = |from: &Point, to: &Point| (to[0] - from[0]).hypot(to[1] - from[1]);
    let whole: f64 = sides().map(|(from, to)| length(from, to)).sum();
    let is_dashed = lengths.iter().any(|length| *length < 0.0) && period > 0.0;
    if !is_dashed || whole < period {
        return Some(vec![points]);
    }
    if whole / period * lengths.len() as f64 > MOST_DASHES {
        return None;
    }
    let mut pattern = lengths.iter().copied().cycle();
    let mut dashes: Vec<Vec<Point>> = Vec::new();
    let mut dash = pattern.next()?;
    let mut left = dash.abs();
    let mut is_new = true;
    for (from, to) in sides() {
        let side = length(from, to);
        let mut at = 0.0;
        let point = |at: f64| {
            let part = if side > 0.0 { at / side } else { 0.0 };
            [0, 1].map(|axis: usize| from[axis] + part * (to[axis] - from[axis]))
        };
        loop {
            if is_new && dash >= 0.0 {
                dashes.push(vec![point(at)]);
            }
            is_new = false;
            let rest = side - at;
            let goes_on = left > rest;
            at = if goes_on { side } else { at + left };
            if dash > 0.0
                && let Some(last) = dashes.last_mut()
            {
                last.push(point(at));
            }
            if goes_on {
                left -= rest;
                break;
            }
            dash = pattern.next()?;
            left = dash.abs();
            is_new = true;
            if at + ROUNDING >= side && left > 0.0 {
                break;
            }
        }
    }
    Some(dashes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_into_dashes_gaps_and_dots_around_corners() {
        let line = vec![[0.0, 0.0], [6.0, 0.0], [6.0, 5.0]];
        let pieces = dashed(line.clone(), &[4.0, -1.0, 0.0, -1.0]);
        let around = vec![[6.0, 0.0], [6.0, 4.0]];
        let expected = vec![vec![[0.0, 0.0], [4.0, 0.0]], vec![[5.0, 0.0]], around];
        assert_eq!(pieces.map(|it| it[..3].to_vec()), Some(expected));
        let corner = dashed(line.clone(), &[8.0, -1.0]).expect("dashes");
        assert_eq!(corner[0], [[0.0, 0.0], [6.0, 0.0], [6.0, 2.0]]);
        assert_eq!(dashed(line.clone(), &[]), Some(vec![line.clone()]));
        assert_eq!(dashed(line.clone(), &[9.0, -9.0]), Some(vec![line.clone()]));
        assert_eq!(dashed(line, &[1e-9, -1e-9]), None);
    }

    /// Lines of many lengths and directions, with corners and without, have as much ink and as many
    /// dots as their line type says.
    #[test]
    fn no_dash_is_lost_whatever_the_length_of_the_line() {
        let types: [&[f64]; 4] = [
            &[12.7, -6.35],
            &[31.75, -6.35, 6.35, -6.35],
            &[0.0, -1.3],
            &[12.7, -6.35, 0.0, -6.35],
        ];
        for (lengths, number) in types.iter().flat_map(|it| (0..500_u32).map(move |at| (*it, at))) {
            let whole = 70.3 + f64::from(number) * 0.26 * std::f64::consts::SQRT_2;
            let (sine, cosine) = f64::from(number).sin_cos();
            let point = |at: f64| [3.3 + at * cosine, 10.0 + at * sine];
            let straight = vec![point(0.0), point(whole)];
            let corners = (0..=number % 9).map(|it| point(whole * f64::from(it) / 9.1));
            let bent: Vec<Point> = corners.chain([point(whole)]).collect();
            for line in [straight, bent] {
                let pieces = dashed(line, lengths).expect("dashes");
                let length = |piece: &[Point]| -> f64 {
                    let sides = piece.windows(2);
                    sides.map(|it| (it[1][0] - it[0][0]).hypot(it[1][1] - it[0][1])).sum()
                };
                let (mut at, mut ink, mut dots) = (0.0, 0.0, 0);
                for dash in lengths.iter().cycle() {
                    if at > whole {
                        break;
                    }
                    ink += dash.max(0.0).min(whole - at);
                    dots += usize::from(*dash == 0.0);
                    at += dash.abs();
                }
                let drawn: f64 = pieces.iter().map(|piece| length(piece)).sum();
                assert!((drawn - ink).abs() < 1e-6, "{lengths:?} {whole}: {drawn} of {ink}");
                let is_dot = |piece: &&Vec<Point>| piece.len() == 1;
                assert_eq!(pieces.iter().filter(is_dot).count(), dots, "{lengths:?} {whole}");
            }
        }
    }
}
