//! Bytes that are damaged on a line.

use crate::random::Random;

/// What arrives of `bytes` if one in `one_in` is damaged, chosen at random, and how many were:
/// `fault` appends what arrives instead of such a byte. Without `one_in` all of them arrive.
pub fn damaged(
    bytes: &[u8],
    one_in: Option<u64>,
    random: &mut Random,
    fault: impl Fn(u8, &mut Random, &mut Vec<u8>),
) -> (Vec<u8>, u32) {
    let (mut arrived, mut count) = (Vec::new(), 0);
    for &byte in bytes {
        if one_in.is_some_and(|one_in| random.below(one_in) == 0) {
            count += 1;
            fault(byte, random, &mut arrived);
        } else {
            arrived.push(byte);
        }
    }
    (arrived, count)
}
