//! Numbers in the text of elements.

use super::super::{CameraError, malformed};
use crate::xml::Element;
use std::path::Path;

/// The number in a child element; `None` where there is no such child.
pub fn child_number(parent: Element<'_>, name: &str, path: &Path) -> Result<Option<f64>, CameraError> {
    parent
        .child(name)
        .map(|child| parse_numbers::<1>(&child.text(), child, path).map(|[value]| value))
        .transpose()
}

/// Exactly N finite numbers.
pub fn parse_numbers<const N: usize>(
    text: &str,
    place: Element<'_>,
    path: &Path,
) -> Result<[f64; N], CameraError> {
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|word| word.parse::<f64>().ok().filter(|v| v.is_finite()))
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| {
            malformed(
                path,
                place.place(),
                format!("{N} numbers expected, found {:?}", text.trim()),
            )
        })
}
