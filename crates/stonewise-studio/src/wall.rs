//! The unrolled wall of results, on which people draw.

use std::fs;
use std::path::Path;
use stonewise::results::names::{FACADE, stones_in};
use stonewise::results::{Facade, facade_of, read_outlines, read_stones};
use stonewise::{Error, Result};
use stonewise_base::files::read_json;

/// The unrolled wall of results, as the report shows it: that of the stones without edits.
///
/// # Errors
/// There are no results, or a file of them is damaged.
pub fn wall_of(results: &Path) -> Result<Facade> {
    let file = results.join(FACADE);
    if fs::exists(&file).map_err(Error::io("reading", &file))? {
        return read_json(&file);
    }
    let stones = read_stones(&stones_in(results)?)?;
    let places = stones.iter().map(|s| (s.stone_id, s.centroid));
    Ok(facade_of(places, &read_outlines(results)?))
}
