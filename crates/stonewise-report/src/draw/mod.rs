//! Pictures of the report as SVG, from the parts in [`stonewise_figure`].
//!
//! Pictures take text colours from the page (`currentColor` and CSS classes), so that they follow light and
//! dark.

mod chart;
mod distance_map;
mod path_chart;
mod stone_map;

pub(crate) use chart::{Guide, Series, histogram, scatter};
pub(crate) use distance_map::distance_map;
pub(crate) use path_chart::{PathChart, path_chart};
pub(crate) use stone_map::{MapLayout, MapPicture, joint_map, stone_map};
