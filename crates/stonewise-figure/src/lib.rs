//! What every picture is made of: axes and their ticks, colours and their bar, escaped text; and pictures
//! that stand alone, SVG files and pages of them.
//!
//! The report's own pictures use the same parts and take their looks from its page.

mod axes;
mod axis;
mod colour;
mod colour_bar;
mod page;
mod plot;
mod scale;
mod text;

pub use axes::Axes;
pub use axis::{Axis, nice_above};
pub use colour::{GREY, PALETTE, Ramp, Rgb, diverging, sequential};
pub use colour_bar::colour_bar;
pub use page::{Page, jpeg_element, table, words};
pub use plot::{Item, Plot};
pub use scale::{Scale, colours};
pub use text::{count, escape, mm, number, percent};
