//! The width of the numbers by which stages refer to vertices, corners, points, segments and so on.
//!
//! A model on a board has fewer than 2^16 of each, so a number takes 16 bits there; a computer
//! takes 32 bits, so that its memory is the only limit. Everything that stores such numbers is
//! generic over an [`Index`], which is `u16` where nothing else is said. The results do not depend
//! on it.

use bytemuck::Pod;
use core::fmt::Debug;
use core::hash::Hash;
use core::ops::{Add, AddAssign, BitAnd, BitOr, BitXor, BitXorAssign, Shl, Shr, Sub, SubAssign};

/// A number that refers to one of many items: `u16` on boards, `u32` on a computer.
///
/// Its greatest value, [`Index::NONE`], refers to nothing, so there are at most as many items.
///
/// ```
/// use penup::index::Index;
/// let pair = u16::pair(1, 2);
/// assert_eq!(u16::halves(pair), [1, 2]);
/// assert!(pair < u16::pair(2, 0));
/// assert_eq!(<u32 as Index>::below(3).map(|number| number.get()).sum::<usize>(), 3);
/// ```
pub trait Index:
    Pod
    + Send
    + Sync
    + Ord
    + Hash
    + Default
    + Debug
    + Into<u32>
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + SubAssign
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
    + BitXorAssign
    + Shl<u32, Output = Self>
    + Shr<u32, Output = Self>
{
    /// A pair of numbers in one, which sorts by the first number and then by the second.
    type Pair: Pod + Send + Sync + Ord + Debug + From<u32> + Into<u64>;

    /// The number 0.
    const ZERO: Self;
    /// The number 1.
    const ONE: Self;
    /// The greatest number, which refers to nothing.
    const NONE: Self;
    /// How many bits a number has.
    const BITS: u32;
    /// Whether memory and code may be spent to save time: on a computer, but not on a board.
    const HAS_ROOM: bool = cfg!(feature = "threads") && Self::BITS > 16;

    /// Makes the number `at`, which must be below 2^[`Index::BITS`]; higher bits are discarded.
    fn new(at: usize) -> Self;
    /// Returns the number as an index of a slice.
    fn get(self) -> usize;
    /// Makes a pair.
    fn pair(first: Self, second: Self) -> Self::Pair;
    /// Returns the two numbers of a pair.
    fn halves(pair: Self::Pair) -> [Self; 2];

    /// Returns the numbers from this one to the one before `end`, in order.
    #[inline]
    fn to(self, end: Self) -> Numbers<Self> {
        Numbers { start: self, end }
    }

    /// Returns the numbers below `count`, in order.
    #[inline]
    fn below(count: Self) -> Numbers<Self> {
        Self::ZERO.to(count)
    }

    /// Returns all numbers but [`Index::NONE`], in order.
    #[inline]
    fn all() -> Numbers<Self> {
        Self::below(Self::NONE)
    }
}

macro_rules! index {
    ($number:ty, $pair:ty) => {
        impl Index for $number {
            type Pair = $pair;
            const ZERO: Self = 0;
            const ONE: Self = 1;
            const NONE: Self = Self::MAX;
            const BITS: u32 = Self::BITS;

            #[inline]
            fn new(at: usize) -> Self {
                at as Self
            }

            #[inline]
            fn get(self) -> usize {
                self as usize
            }

            #[inline]
            fn pair(first: Self, second: Self) -> $pair {
                <$pair>::from(first) << Self::BITS | <$pair>::from(second)
            }

            #[inline]
            fn halves(pair: $pair) -> [Self; 2] {
                [(pair >> Self::BITS) as Self, pair as Self]
            }
        }
    };
}

index!(u16, u32);
index!(u32, u64);

/// The numbers from `start` to the one before `end`, as a range of a primitive type would be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Numbers<I> {
    /// The first number.
    pub start: I,
    /// The number after the last.
    pub end: I,
}

impl<I: Index> Numbers<I> {
    /// Returns how many numbers there are.
    pub fn len(&self) -> usize {
        self.end.get().saturating_sub(self.start.get())
    }

    /// Whether the range contains no numbers.
    pub fn is_empty(&self) -> bool {
        self.end <= self.start
    }
}

impl<I: Index> Iterator for Numbers<I> {
    type Item = I;

    #[inline]
    fn next(&mut self) -> Option<I> {
        if self.start >= self.end {
            return None;
        }
        let number = self.start;
        self.start += I::ONE;
        Some(number)
    }

    #[inline]
    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.len(), Some(self.len()))
    }
}

impl<I: Index> DoubleEndedIterator for Numbers<I> {
    #[inline]
    fn next_back(&mut self) -> Option<I> {
        if self.start >= self.end {
            return None;
        }
        self.end -= I::ONE;
        Some(self.end)
    }
}

impl<I: Index> ExactSizeIterator for Numbers<I> {}
