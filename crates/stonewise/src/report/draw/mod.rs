//! Pictures of the report as SVG, from the parts in [`crate::figure`].
//!
//! Pictures take text colours from the page (`currentColor` and CSS classes), so that they follow light and dark.

mod chart;
mod colour_bar;
mod distance_map;
mod stone_map;

pub(crate) use chart::{Series, histogram, scatter};
pub(crate) use colour_bar::{Scale, colours, component_limit_m, component_limit_of, nice_scale_m};
pub(crate) use distance_map::distance_map;
pub(crate) use stone_map::{MapLayout, MapPicture, joint_map, stone_map};
