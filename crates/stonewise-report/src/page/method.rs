//! How to read the figures, and what they do not say.

use super::html::section;
use crate::texts::Texts;

/// Method, definitions and limits of the statement.
pub(super) fn method(texts: &Texts) -> String {
    section("method", texts.sections.method_title, texts.method.body)
}
