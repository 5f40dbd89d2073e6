//! Pictures that stand alone: SVG files with their own colours, and pages of them.
//!
//! The report's pictures take their looks from its page; these are also files of their own, in documents.

mod axis;
mod colour;
mod page;
mod plot;

pub(crate) use axis::Axis;
pub(crate) use colour::{GREY, PALETTE, Ramp};
pub(crate) use page::{Page, jpeg_element, table};
pub(crate) use plot::{Item, Plot};
