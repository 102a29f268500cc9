//! How far it is.

use crate::drawing::PagePoint;

/// The distance between two points of the page in 1/256 steps, rounded down.
///
/// Points within ±[`PAGE_LIMIT`](crate::drawing::PAGE_LIMIT): the square fits 43 bits, the distance
/// 30.
///
/// ```
/// use penup::{drawing::PagePoint, order::length};
/// let origin = PagePoint { x: 0, y: 0 };
/// assert_eq!(length(origin, PagePoint { x: 3, y: -4 }), 5 << 8);
/// assert_eq!(length(origin, PagePoint { x: 1, y: 1 }), 362);
/// ```
pub fn length(a: PagePoint, b: PagePoint) -> u32 {
    let (dx, dy) = (a.x.abs_diff(b.x), a.y.abs_diff(b.y));
    let square = u64::from(dx) * u64::from(dx) + u64::from(dy) * u64::from(dy);
    (square << 16).isqrt() as u32
}
