//! Views of a cloud: pictures as a camera would take them, for surveys without photos.
//!
//! [`plan_views`] places cameras that cover the walls of a cloud from several directions; [`Picture`] collects
//! the points that such a camera sees and becomes an image of their colour, their intensity or their relief.
//!
//! For surveys with photos, [`Sights`] says what each of them shows of the walls, and chooses among them.

mod cover;
mod fill;
mod hidden;
mod obstacles;
mod params;
mod picture;
mod plan;
mod shade;
mod tone;
mod walls;

pub use cover::{Sight, Sights};
pub use params::ViewParams;
pub use picture::Picture;
pub use plan::{PlannedView, megapixels_of, plan_views};
pub use tone::{PointValues, Shade, Tones, Toning};
pub use walls::Walls;
