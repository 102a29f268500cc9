//! Arrays of a few items, as points and the ends of lines are, and the reversal of slices.

/// Reverses the order of items. The standard library's `reverse` leaves a check in a device's image
/// that the compiler cannot prove away.
///
/// ```
/// let mut items = [1, 2, 3, 4, 5];
/// penup::array::reverse(&mut items);
/// assert_eq!(items, [5, 4, 3, 2, 1]);
/// ```
pub fn reverse<T>(items: &mut [T]) {
    let mut items = items.iter_mut();
    while let (Some(first), Some(last)) = (items.next(), items.next_back()) {
        core::mem::swap(first, last);
    }
}

/// Moves the first `count` items behind the others. The standard library's `rotate_left` is faster
/// for large slices, and takes more flash than all that calls it.
///
/// ```
/// let mut items = [1, 2, 3, 4, 5];
/// penup::array::rotate_left(&mut items, 2);
/// assert_eq!(items, [3, 4, 5, 1, 2]);
/// ```
pub fn rotate_left<T>(items: &mut [T], count: usize) {
    let (first, others) = items.split_at_mut(count.min(items.len()));
    reverse(first);
    reverse(others);
    reverse(items);
}

/// Maps arrays of two to four items.
pub trait MapEach<T, const N: usize> {
    /// Applies `f` to each item, from the first to the last.
    ///
    /// The standard library's `map` is written for arrays of any length, whose items may need to be
    /// dropped. On a device, each of its calls takes some 20 bytes more than this, unless `f` is
    /// long and called from one place only.
    ///
    /// ```
    /// use penup::array::MapEach;
    /// assert_eq!([1, 2, 3].map_each(|number| 10 * number), [10, 20, 30]);
    /// ```
    fn map_each<U>(self, f: impl FnMut(T) -> U) -> [U; N];
}

impl<T> MapEach<T, 2> for [T; 2] {
    fn map_each<U>(self, mut f: impl FnMut(T) -> U) -> [U; 2] {
        let [a, b] = self;
        [f(a), f(b)]
    }
}

impl<T> MapEach<T, 3> for [T; 3] {
    fn map_each<U>(self, mut f: impl FnMut(T) -> U) -> [U; 3] {
        let [a, b, c] = self;
        [f(a), f(b), f(c)]
    }
}

impl<T> MapEach<T, 4> for [T; 4] {
    fn map_each<U>(self, mut f: impl FnMut(T) -> U) -> [U; 4] {
        let [a, b, c, d] = self;
        [f(a), f(b), f(c), f(d)]
    }
}
