//! Exact fractions that are reduced only when they become long, which is several times faster than
//! reducing them always.

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{Signed, ToPrimitive, Zero};
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A fraction whose denominator is positive.
#[derive(Debug, Clone)]
pub struct Fraction {
    numerator: BigInt,
    denominator: BigInt,
}

/// The length in bits above which denominators are reduced.
const LONG_BITS: u64 = 160;

impl Fraction {
    /// Creates `numerator / denominator`; the denominator must not be zero.
    pub fn new(numerator: impl Into<BigInt>, denominator: impl Into<BigInt>) -> Self {
        let (mut numerator, mut denominator) = (numerator.into(), denominator.into());
        assert!(!denominator.is_zero(), "division by zero");
        if denominator.is_negative() {
            (numerator, denominator) = (-numerator, -denominator);
        }
        if denominator.bits() > LONG_BITS {
            let common = numerator.gcd(&denominator);
            numerator /= &common;
            denominator /= common;
        }
        Self { numerator, denominator }
    }

    /// Creates a whole number.
    pub fn whole(value: i32) -> Self {
        Self::new(value, 1)
    }

    /// Zero.
    pub fn zero() -> Self {
        Self::whole(0)
    }

    /// One.
    pub fn one() -> Self {
        Self::whole(1)
    }

    /// Whether it is zero.
    pub fn is_zero(&self) -> bool {
        self.numerator.is_zero()
    }

    /// Whether it is positive.
    pub fn is_positive(&self) -> bool {
        self.numerator.is_positive()
    }

    /// Whether it is negative.
    pub fn is_negative(&self) -> bool {
        self.numerator.is_negative()
    }

    /// The reciprocal.
    pub fn recip(&self) -> Self {
        Self::new(self.denominator.clone(), self.numerator.clone())
    }

    /// The nearest float, or one close to it.
    pub fn to_f64(&self) -> f64 {
        let scaled: BigInt = (&self.numerator << 60u32) / &self.denominator;
        scaled.to_f64().unwrap_or(f64::NAN) / (1u64 << 60) as f64
    }

    /// The absolute value.
    pub fn abs(&self) -> Self {
        Self { numerator: self.numerator.abs(), denominator: self.denominator.clone() }
    }
}

impl Default for Fraction {
    fn default() -> Self {
        Self::zero()
    }
}

impl Ord for Fraction {
    fn cmp(&self, other: &Self) -> Ordering {
        (&self.numerator * &other.denominator).cmp(&(&other.numerator * &self.denominator))
    }
}
impl PartialOrd for Fraction {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Fraction {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Fraction {}

impl Neg for Fraction {
    type Output = Fraction;
    fn neg(self) -> Fraction {
        -&self
    }
}
impl Neg for &Fraction {
    type Output = Fraction;
    fn neg(self) -> Fraction {
        Fraction { numerator: -&self.numerator, denominator: self.denominator.clone() }
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, |$a:ident, $b:ident| $result:expr) => {
        impl $trait<&Fraction> for &Fraction {
            type Output = Fraction;
            fn $method(self, other: &Fraction) -> Fraction {
                let ($a, $b) = (self, other);
                $result
            }
        }
        impl $trait<Fraction> for &Fraction {
            type Output = Fraction;
            fn $method(self, other: Fraction) -> Fraction {
                self.$method(&other)
            }
        }
        impl $trait<&Fraction> for Fraction {
            type Output = Fraction;
            fn $method(self, other: &Fraction) -> Fraction {
                (&self).$method(other)
            }
        }
        impl $trait<Fraction> for Fraction {
            type Output = Fraction;
            fn $method(self, other: Fraction) -> Fraction {
                (&self).$method(&other)
            }
        }
    };
}

operator!(Mul, mul, |a, b| Fraction::new(
    &a.numerator * &b.numerator,
    &a.denominator * &b.denominator
));
operator!(Div, div, |a, b| Fraction::new(
    &a.numerator * &b.denominator,
    &a.denominator * &b.numerator
));
operator!(Add, add, |a, b| if a.denominator == b.denominator {
    Fraction::new(&a.numerator + &b.numerator, a.denominator.clone())
} else {
    Fraction::new(
        &a.numerator * &b.denominator + &b.numerator * &a.denominator,
        &a.denominator * &b.denominator,
    )
});
operator!(Sub, sub, |a, b| a + &-b);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_four_operations_are_those_of_fractions() {
        let (a, b) = (Fraction::new(3, -4), Fraction::new(10, 12));
        assert_eq!(&a + &b, Fraction::new(1, 12));
        assert_eq!(&a - &b, Fraction::new(-19, 12));
        assert_eq!(&a * &b, Fraction::new(-5, 8));
        assert_eq!(&a / &b, Fraction::new(-9, 10));
        assert!(a < b && a.is_negative() && a.abs() < b);
        let tiny = (0..100).fold(Fraction::one(), |tiny, _| tiny / Fraction::whole(1000));
        assert!(tiny.is_positive() && tiny.recip() * &tiny == Fraction::one());
    }
}
