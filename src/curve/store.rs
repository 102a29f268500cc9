//! The curves that the user sent, in memory lent by the owner.
//!
//! They come as OBJ writes them: `deg 3`, `curv u0 u1 i1 i2 …`, `parm u k1 k2 …` (none, or as many lines
//! as it takes), `end`. Without `parm` the knots are 0, 1, 2, … Each curve lies in words of 32 bits: four
//! of header, its control points two to a word, its knots one to a word if it has any of its own.

use super::{
    CurveError, KNOT_LIMIT, Knots, Parameter, Point, Spline, check_interior, check_shape,
    parameter_of,
};
use crate::fixed::{Decimal, shift_right_rounding};

/// Why a curve was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// The degree comes first.
    NoDegree,
    /// The curve before has no `end`.
    Unfinished,
    /// Knots or an end without a curve.
    NoCurve,
    /// No room.
    Full {
        /// How many words of 32 bits there can be.
        limit: usize,
        /// How many there would have been.
        needed: usize,
    },
    /// A parameter or knot is past ±2^22.
    TooLarge,
    /// It is no curve.
    Curve(CurveError),
}

impl From<CurveError> for StoreError {
    fn from(error: CurveError) -> Self {
        Self::Curve(error)
    }
}

/// One stored curve.
#[derive(Debug, Clone, Copy)]
pub struct StoredCurve<'a> {
    /// Degree + 1.
    pub order: u8,
    /// The numbers of its control points, from 0.
    pub control: &'a [u16],
    /// Its knots.
    pub knots: Knots<'a>,
    /// Where it begins.
    pub from: Parameter,
    /// Where it ends.
    pub to: Parameter,
}

impl<'a> StoredCurve<'a> {
    /// The curve over these points.
    ///
    /// # Errors
    /// [`CurveError::UnknownPoint`] if `points` has not all of its control points.
    pub fn spline(&self, points: &'a [Point]) -> Result<Spline<'a>, CurveError> {
        Spline::new(points, self.control, self.order, self.knots)
            .map(|whole| whole.between(self.from, self.to))
    }
}

/// The curves of a model, in the order in which they came.
#[derive(Debug)]
pub struct CurveStore<'m> {
    words: &'m mut heapless::VecView<u32>,
    /// Words of whole curves; those of the curve in hand follow.
    whole: usize,
    count: usize,
    degree: Option<u8>,
    in_hand: Option<InHand>,
}

/// A curve whose `end` has not come.
#[derive(Debug, Clone, Copy)]
struct InHand {
    order: u8,
    control_points: usize,
    from: Decimal,
    to: Decimal,
    /// The unit of its knots is 2^-this; `None` while it has none of its own.
    fraction_bits: Option<u32>,
}

/// Words before the control points: order and number of control points; of knots; both ends.
const HEADER: usize = 4;

/// The finest unit of a knot, 2^-22, which holds |knot| <= 1.
const FINEST: u32 = 22;

/// Without knots of its own, a curve's ends are kept to 2^-16 of the distance between knots.
const UNIFORM_BITS: u32 = 16;

impl<'m> CurveStore<'m> {
    /// None; what `words` holds is forgotten.
    pub fn new(words: &'m mut heapless::VecView<u32>) -> Self {
        words.clear();
        Self { words, whole: 0, count: 0, degree: None, in_hand: None }
    }

    /// Forgets every curve, the one in hand too.
    pub fn clear(&mut self) {
        self.words.clear();
        (self.whole, self.count, self.degree, self.in_hand) = (0, 0, None, None);
    }

    /// How many curves there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many words of 32 bits they take.
    pub fn word_count(&self) -> usize {
        self.whole
    }

    /// How many words of 32 bits there can be.
    pub fn word_limit(&self) -> usize {
        self.words.capacity()
    }

    /// `deg`: the degree of the curves that follow, 1 to 5.
    ///
    /// # Errors
    /// [`CurveError::Order`]; nothing is changed.
    pub fn set_degree(&mut self, degree: u8) -> Result<(), StoreError> {
        if !(1..=5).contains(&degree) {
            return Err(CurveError::Order.into());
        }
        self.degree = Some(degree);
        Ok(())
    }

    /// `curv`: begins a curve from `from` to `to` over the points numbered `control`, from 0.
    ///
    /// The caller has checked that each of them exists.
    ///
    /// # Errors
    /// See [`StoreError`]; nothing is changed.
    pub fn begin(
        &mut self,
        [from, to]: [Decimal; 2],
        control: impl Iterator<Item = u16> + Clone,
    ) -> Result<(), StoreError> {
        if self.in_hand.is_some() {
            return Err(StoreError::Unfinished);
        }
        let order = self.degree.ok_or(StoreError::NoDegree)? + 1;
        let control_points = control.clone().count();
        check_shape(control_points, order, Knots::Uniform)?;
        self.check_room(HEADER + control_points.div_ceil(2))?;
        let mut rest = control;
        let header = [u32::from(order) << 16 | control_points as u32, 0, 0, 0];
        let pairs = core::iter::from_fn(|| {
            let first = rest.next()?;
            let pair: u32 = bytemuck::cast([first, rest.next().unwrap_or(0)]);
            Some(pair)
        });
        self.words.extend(header.into_iter().chain(pairs));
        self.in_hand = Some(InHand { order, control_points, from, to, fraction_bits: None });
        Ok(())
    }

    /// `parm u`: more knots of the curve in hand.
    ///
    /// All share one binary unit, which grows when a larger knot comes; each keeps 22 bits of the
    /// largest.
    ///
    /// # Errors
    /// [`StoreError::NoCurve`], [`StoreError::Full`], [`StoreError::TooLarge`]; nothing is changed.
    pub fn add_knots(
        &mut self,
        knots: impl Iterator<Item = Decimal> + Clone,
    ) -> Result<(), StoreError> {
        let in_hand = self.in_hand.ok_or(StoreError::NoCurve)?;
        let before = in_hand.fraction_bits.unwrap_or(FINEST);
        let fraction_bits = (0..=before)
            .rev()
            .find(|bits| knots.clone().all(|knot| in_unit(knot, *bits).is_some()))
            .ok_or(StoreError::TooLarge)?;
        self.check_room(knots.clone().count())?;
        let start = self.whole + HEADER + in_hand.control_points.div_ceil(2);
        for knot in self.words.iter_mut().skip(start) {
            let coarser = shift_right_rounding(bytemuck::cast(*knot), before - fraction_bits);
            *knot = bytemuck::cast(coarser);
        }
        let words = knots.filter_map(|knot| in_unit(knot, fraction_bits)).map(|k| k as u32);
        self.words.extend(words);
        self.in_hand = Some(InHand { fraction_bits: Some(fraction_bits), ..in_hand });
        Ok(())
    }

    /// `end`: the curve in hand is whole. If it is refused it is forgotten.
    ///
    /// # Errors
    /// [`StoreError::NoCurve`], [`StoreError::TooLarge`], [`StoreError::Curve`].
    pub fn end(&mut self) -> Result<(), StoreError> {
        let in_hand = self.in_hand.take().ok_or(StoreError::NoCurve)?;
        match self.close(&in_hand) {
            Ok(()) => {
                self.whole = self.words.len();
                self.count += 1;
                Ok(())
            }
            Err(error) => {
                self.words.truncate(self.whole);
                Err(error)
            }
        }
    }

    /// Checks the curve in hand and completes its header.
    fn close(&mut self, in_hand: &InHand) -> Result<(), StoreError> {
        let InHand { order, control_points, .. } = *in_hand;
        let start = self.whole + HEADER + control_points.div_ceil(2);
        let knot_words = self.words.get(start..).unwrap_or(&[]);
        let knot_count = knot_words.len();
        let (knots, bits, fraction_bits) = match in_hand.fraction_bits {
            Some(bits) => (Knots::Listed(bytemuck::cast_slice(knot_words)), bits, 0),
            None => (Knots::Uniform, 0, UNIFORM_BITS),
        };
        check_shape(control_points, order, knots)?;
        let value = |u: Decimal| {
            let limit = i64::from(KNOT_LIMIT) << fraction_bits;
            let value = u.to_binary(bits + fraction_bits).map_err(|_| StoreError::TooLarge)?;
            if value.abs() <= limit { Ok(value) } else { Err(StoreError::TooLarge) }
        };
        let (from, to) = (value(in_hand.from)?, value(in_hand.to)?);
        // The same number may be a unit apart as an end and as a knot that was rounded twice.
        let first = knots.get(usize::from(order) - 1) << fraction_bits;
        let last = knots.get(control_points) << fraction_bits;
        if from < first - 1 || to > last + 1 {
            return Err(CurveError::OutsideKnots.into());
        }
        let (from, to) = (from.max(first), to.min(last));
        check_interior(order, knots, from, to)?;
        let [from, to] =
            [from, to].map(|u| parameter_of(control_points, order, knots, u, fraction_bits));
        let header = [u32::from(order) << 16 | control_points as u32, knot_count as u32]
            .into_iter()
            .chain([from.to_bits(), to.to_bits()]);
        for (word, value) in self.words.iter_mut().skip(self.whole).zip(header) {
            *word = value;
        }
        Ok(())
    }

    /// Every whole curve in turn.
    pub fn iter(&self) -> impl Iterator<Item = StoredCurve<'_>> + Clone {
        let mut rest = self.words.get(..self.whole).unwrap_or(&[]);
        core::iter::from_fn(move || {
            let (curve, after) = read(rest)?;
            rest = after;
            Some(curve)
        })
    }

    /// Gives control points new numbers, as the model does with its vertices. A curve with a control
    /// point that `number` maps to `None` goes. Returns how many went.
    ///
    /// The curve in hand goes too, and is not counted.
    pub fn renumber(&mut self, number: impl Fn(u16) -> Option<u16>) -> usize {
        self.in_hand = None;
        self.words.truncate(self.whole);
        let (mut read_at, mut write_at, mut kept) = (0, 0, 0);
        while let Some((length, control_points)) = self.words.get(read_at..).and_then(lengths) {
            let words = read_at..read_at + length;
            let control = self.words.get_mut(words.clone()).unwrap_or(&mut []);
            let control: &mut [u16] =
                bytemuck::cast_slice_mut(control.get_mut(HEADER..).unwrap_or(&mut []));
            let stays = control
                .iter_mut()
                .take(control_points)
                .all(|control| number(*control).inspect(|new| *control = *new).is_some());
            if stays {
                self.words.copy_within(words, write_at);
                write_at += length;
                kept += 1;
            }
            read_at += length;
        }
        self.words.truncate(write_at);
        self.whole = write_at;
        let gone = self.count - kept;
        self.count = kept;
        gone
    }

    fn check_room(&self, more: usize) -> Result<(), StoreError> {
        let limit = self.word_limit();
        let needed = self.words.len().saturating_add(more);
        if needed > limit { Err(StoreError::Full { limit, needed }) } else { Ok(()) }
    }
}

/// How many words the first curve of `words` takes, and how many control points it has.
fn lengths(words: &[u32]) -> Option<(usize, usize)> {
    let control_points = (*words.first()? & 0xFFFF) as usize;
    let knots = *words.get(1)? as usize;
    Some((HEADER + control_points.div_ceil(2) + knots, control_points))
}

/// The first curve of `words`, and the words after it.
fn read(words: &[u32]) -> Option<(StoredCurve<'_>, &[u32])> {
    let (length, control_points) = lengths(words)?;
    let (curve, after) = words.split_at_checked(length)?;
    let (header, rest) = curve.split_at_checked(HEADER)?;
    let (control, knots) = rest.split_at_checked(control_points.div_ceil(2))?;
    let control: &[u16] = bytemuck::cast_slice(control);
    let knots = match knots {
        [] => Knots::Uniform,
        knots => Knots::Listed(bytemuck::cast_slice(knots)),
    };
    let [order, _, from, to] = *header else { return None };
    let order = (order >> 16) as u8;
    let [from, to] = [from, to].map(Parameter::from_bits);
    Some((StoredCurve { order, control: control.get(..control_points)?, knots, from, to }, after))
}

/// A knot in units of 2^-`fraction_bits`, if it fits.
fn in_unit(knot: Decimal, fraction_bits: u32) -> Option<i32> {
    let value = i32::try_from(knot.to_binary(fraction_bits).ok()?).ok()?;
    (value.unsigned_abs() <= KNOT_LIMIT.unsigned_abs()).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    type Words = heapless::Vec<u32, 24>;

    fn decimal(text: &str) -> Decimal {
        Decimal::parse(text).unwrap()
    }

    fn decimals(text: &str) -> impl Iterator<Item = Decimal> + Clone {
        text.split(' ').map(decimal)
    }

    fn sent(
        store: &mut CurveStore<'_>,
        ends: [&str; 2],
        control: &[u16],
        knots: &[&str],
    ) -> Result<(), StoreError> {
        store.begin(ends.map(decimal), control.iter().copied())?;
        for line in knots {
            store.add_knots(decimals(line))?;
        }
        store.end()
    }

    fn controls(store: &CurveStore<'_>) -> Vec<Vec<u16>> {
        store.iter().map(|curve| curve.control.to_vec()).collect()
    }

    #[test]
    fn curves_come_back_as_they_were_sent() {
        let mut words = Words::new();
        let mut store = CurveStore::new(&mut words);
        store.set_degree(2).unwrap();
        sent(&mut store, ["2.5", "4"], &[0, 1, 2, 3, 0], &[]).unwrap();
        // A knot past 1 coarsens those before it.
        sent(&mut store, ["0", "3"], &[4, 3, 2, 1], &["0 0 0", "0.5", "3 3 3"]).unwrap();
        let curves: Vec<_> = store.iter().collect();
        assert_eq!(curves.len(), 2);
        assert_eq!(
            (curves[0].order, curves[0].control, curves[0].knots),
            (3, &[0, 1, 2, 3, 0][..], Knots::Uniform)
        );
        assert_eq!((curves[0].from.to_bits(), curves[0].to.to_bits()), (1 << 19, 2 << 20));
        let unit = 1 << 20;
        let knots = [0, 0, 0, unit / 2, 3 * unit, 3 * unit, 3 * unit];
        assert_eq!(
            (curves[1].control, curves[1].knots),
            (&[4, 3, 2, 1][..], Knots::Listed(&knots))
        );
        assert_eq!((store.count(), store.word_count()), (2, 4 + 3 + 4 + 2 + 7));
        assert!(curves[1].spline(&[[0; 3]; 5]).is_ok());
        assert!(matches!(
            curves[1].spline(&[[0; 3]; 4]),
            Err(CurveError::UnknownPoint { number: 4 })
        ));
        store.clear();
        assert_eq!((store.count(), store.iter().count()), (0, 0));
    }

    #[test]
    fn what_is_refused_leaves_nothing_behind() {
        let mut words = Words::new();
        let mut store = CurveStore::new(&mut words);
        let three = [0, 1, 2];
        assert_eq!(sent(&mut store, ["2", "3"], &three, &[]), Err(StoreError::NoDegree));
        assert_eq!(store.add_knots(decimals("1")), Err(StoreError::NoCurve));
        assert_eq!(store.end(), Err(StoreError::NoCurve));
        for degree in [0, 6] {
            assert_eq!(store.set_degree(degree), Err(CurveError::Order.into()));
        }
        store.set_degree(2).unwrap();
        sent(&mut store, ["2", "3"], &three, &[]).unwrap();
        let full = StoreError::Full { limit: 24, needed: 6 + 4 + 15 };
        let wrong_count = CurveError::WrongKnotCount { needed: 6, given: 5 }.into();
        for (ends, control, knots, error) in [
            (
                ["2", "3"],
                &three[..2],
                &[][..],
                CurveError::TooFewControlPoints { needed: 3 }.into(),
            ),
            (["2", "3"], &[7; 29], &[], full),
            (["0", "1"], &three, &[], CurveError::OutsideKnots.into()),
            (["3", "2"], &three, &[], CurveError::OutsideKnots.into()),
            (["2", "1e30"], &three, &[], StoreError::TooLarge),
            (["2", "4"], &three, &[], CurveError::OutsideKnots.into()),
            (["0", "1"], &three, &["0 0 0 1 1"], wrong_count),
            (["0", "1"], &three, &["0 0 0 1 2 1"], CurveError::KnotDecreases { knot: 5 }.into()),
        ] {
            assert_eq!(sent(&mut store, ends, control, knots), Err(error), "{ends:?} {knots:?}");
            assert_eq!((store.count(), store.word_count(), store.words.len()), (1, 6, 6));
        }
        assert_eq!(controls(&store), [three]);
    }

    #[test]
    fn a_refused_line_leaves_the_curve_in_hand() {
        let mut words = Words::new();
        let mut store = CurveStore::new(&mut words);
        store.set_degree(1).unwrap();
        store.begin(["0", "1"].map(decimal), [4, 5].into_iter()).unwrap();
        assert_eq!(
            store.begin(["0", "1"].map(decimal), [4, 5].into_iter()),
            Err(StoreError::Unfinished)
        );
        store.add_knots(decimals("0 0")).unwrap();
        assert_eq!(store.add_knots(decimals("1e9")), Err(StoreError::TooLarge));
        let many = core::iter::repeat_n(decimal("7"), 99);
        assert_eq!(store.add_knots(many), Err(StoreError::Full { limit: 24, needed: 5 + 2 + 99 }));
        store.add_knots(decimals("1 1")).unwrap();
        store.end().unwrap();
        assert_eq!(store.iter().next().unwrap().knots, Knots::Listed(&[0, 0, 1 << 22, 1 << 22]));
    }

    #[test]
    fn renumbering_keeps_curves_whose_points_stay() {
        let mut words = Words::new();
        let mut store = CurveStore::new(&mut words);
        store.set_degree(1).unwrap();
        for control in [&[0, 1, 2][..], &[3, 4], &[5, 0, 6]] {
            sent(&mut store, ["1", "2"], control, &[]).unwrap();
        }
        // Vertex 4 goes, those above it move down.
        let gone = store.renumber(|number| (number != 4).then_some(number - u16::from(number > 4)));
        assert_eq!(gone, 1);
        assert_eq!(controls(&store), [[0, 1, 2], [4, 0, 5]]);
        assert_eq!((store.count(), store.word_count()), (2, 12));
    }
}
