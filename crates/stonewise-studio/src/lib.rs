//! The page to work in: a server on the loopback address, its JSON API, and what it keeps.
//!
//! The library does the work; the page is TypeScript in `web/studio`. docs/src/edits.md says what the page does and
//! who can use it.

mod api;
mod assets;
mod elsewhere;
mod epochs;
mod guard;
mod http;
mod journal;
mod place;
mod project_text;
mod remarks;
mod sightings;
mod stable;
mod studio;
mod teaching;
mod wall;
mod work;

pub use api::typescript;
pub use studio::Studio;
