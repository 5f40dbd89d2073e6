//! What every picture is made of: axes and their ticks, colours and their bar, escaped text; and pictures
//! that stand alone, SVG files and pages of them.
//!
//! The report's own pictures use the same parts and take their looks from its page.
//!
//! ```
//! use stonewise_figure::{Axis, Item, PALETTE, Plot};
//!
//! let (x, y) = (Axis::linear("epoch", [1.0, 3.0]), Axis::linear("motion (mm)", [0.0, 5.0]));
//! let mut plot = Plot::new("Stone 28", x, y, [480.0, 320.0]);
//! plot.add(Item::Line {
//!     points: vec![[1.0, 0.0], [2.0, 1.4], [3.0, 4.2]],
//!     colour: PALETTE[0].to_string(),
//!     dashed: false,
//!     marks: true,
//!     name: String::new(),
//! });
//! assert!(plot.svg().starts_with("<svg"));
//! ```

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
