//! Grids of geoids as GRAVSOFT text: `.gri` files, and `WW15MGH.GRD` of EGM96.
//!
//! The limits in the south, north, west and east and the steps to the north and to the east come first, in degrees. The
//! heights follow in metres, in rows from north to south, each from west to east, with any number of heights in a line
//! (Forsberg and Tscherning 2008, "An overview manual for the GRAVSOFT Geodetic Gravity Field Modelling Programs").

use super::geoid::Geoid;

/// Largest part of a step by which limits may miss a node; they are rounded.
const ROUNDING: f64 = 0.01;
/// Most steps of a row or column, so that the number of heights fits into 32 bits.
const MOST_STEPS: f64 = 5e4;

/// Reads a grid; `None` for files that do not begin with six numbers.
pub fn read(bytes: &[u8]) -> Option<Result<Geoid, String>> {
    let text = str::from_utf8(bytes).ok()?;
    let mut words = text.split_ascii_whitespace();
    let mut head = [0.0; 6];
    for number in &mut head {
        *number = words.next()?.parse::<f64>().ok()?;
    }
    Some(grid(head, words))
}

fn grid<'a>(head: [f64; 6], words: impl Iterator<Item = &'a str>) -> Result<Geoid, String> {
    let [south, north, west, east, north_step, east_step] = head;
    let steps = [(north - south) / north_step, (east - west) / east_step];
    let is_sound =
        |steps: f64| (1.0..MOST_STEPS).contains(&steps) && (steps - steps.round()).abs() < ROUNDING;
    if !steps.iter().all(|steps| is_sound(*steps)) {
        return Err("the limits of its first line are not whole numbers of steps apart".to_owned());
    }
    let [rows, columns] = steps.map(|steps| steps.round() as usize + 1);
    let heights: Result<Vec<f32>, _> = words.map(str::parse).collect();
    let heights = heights.map_err(|_| "a height is not a number".to_owned())?;
    if heights.len() != rows * columns {
        return Err(format!(
            "it has {} heights instead of {rows} x {columns}",
            heights.len()
        ));
    }
    let from_south: Vec<f32> = heights.chunks(columns).rev().flatten().copied().collect();
    Geoid::of(
        [south, west],
        [north_step, east_step],
        [rows, columns],
        from_south,
    )
    .ok_or_else(|| "its size or place is impossible".to_owned())
}
