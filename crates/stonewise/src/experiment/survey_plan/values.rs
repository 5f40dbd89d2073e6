//! What the values of a plan may be; errors name the key and the fix.

use std::fmt::Display;
use std::ops::RangeInclusive;

/// A length or an angle that cannot be zero.
pub(super) fn positive(key: impl Display, value: f64) -> Result<(), String> {
    match value.is_finite() && value > 0.0 {
        true => Ok(()),
        false => Err(format!("{key} = {value}: a positive number is needed")),
    }
}

/// An error, or a length that may be zero.
pub(super) fn not_negative(key: impl Display, value: f64) -> Result<(), String> {
    match value.is_finite() && value >= 0.0 {
        true => Ok(()),
        false => Err(format!("{key} = {value}: a number is needed, 0 or larger")),
    }
}

/// A number of things.
pub(super) fn count(key: impl Display, value: u32, range: RangeInclusive<u32>) -> Result<(), String> {
    match range.contains(&value) {
        true => Ok(()),
        false => Err(format!(
            "{key} = {value}: a number from {} to {} is needed",
            range.start(),
            range.end()
        )),
    }
}
