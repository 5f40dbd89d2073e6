//! What every picture is made of: axes and their ticks, colours and their bar, escaped text; and pictures
//! that stand alone, SVG files and pages of them.
//!
//! The report's own pictures ([`crate::report`]) use the same parts and take their looks from its page.

mod axes;
mod axis;
mod colour;
mod colour_bar;
mod page;
mod plot;
mod scale;
mod text;

pub(crate) use axes::Axes;
pub(crate) use axis::{Axis, nice_above};
pub(crate) use colour::{GREY, PALETTE, Ramp, Rgb, diverging, sequential};
pub(crate) use colour_bar::colour_bar;
pub(crate) use page::{Page, jpeg_element, table, words};
pub(crate) use plot::{Item, Plot};
pub(crate) use scale::{Scale, colours};
pub(crate) use text::{count, escape, mm, number, percent};
