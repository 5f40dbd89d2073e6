//! The JSON API, `/api/v1`: what can be asked, in which types.
//!
//! The types are written down once, here and where they belong; the TypeScript of the page is made from their schema
//! ([`typescript()`]), and a test compares it with the file of the page.

mod routes;
mod types;
mod typescript;

pub use routes::{Api, Served};
pub use typescript::typescript;
