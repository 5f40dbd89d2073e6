//! Renders a sheet of the photos that the built-in weights learn from, to look at beside real ones.
//!
//! `cargo run --release -p stonewise-lab -- masonry-sheet SHEET.png [FIRST_SEED] [COLUMNS] [ROWS] [SIZE]
//! [overlay] [dry]`

use crate::Outcome;
use crate::words::Words;
use stonewise_segment::Sample;
use stonewise_segment::train::synth::{MasonryStyle, masonry_photo_of};

pub fn run(words: &Words) -> Outcome {
    let path = words.as_slice().first().ok_or("say where to write the sheet")?;
    let first: u64 = words.number_at(1).unwrap_or(0);
    let [columns, rows, size] =
        [(2, 4), (3, 2), (4, 384)].map(|(place, or)| words.number_at(place).unwrap_or(or));
    let style = if words.has("dry") {
        MasonryStyle::dry
    } else {
        MasonryStyle::random
    };
    let mut sheet = image::RgbImage::new(columns * size, rows * size);
    let start = std::time::Instant::now();

    for tile in 0..columns * rows {
        let seed = first + u64::from(tile);
        let sample = masonry_photo_of(&style(seed, size, size), None, seed, size, size);
        for (i, &colour) in sample.image().data().iter().enumerate() {
            let colour = if words.has("overlay") {
                marked(&sample, i, colour)
            } else {
                colour
            };
            let (x, y) = (i as u32 % size, i as u32 / size);
            let at = (tile % columns * size + x, tile / columns * size + y);
            sheet.put_pixel(at.0, at.1, image::Rgb(colour));
        }
    }

    let each = start.elapsed().as_secs_f64() * 1000.0 / f64::from((columns * rows).max(1));
    sheet.save(path)?;
    println!("{path}: {each:.1} ms a photo");
    Ok(())
}

/// Each stone tinted in a colour of its own with a bright outline, doubtful places dark.
fn marked(sample: &Sample, i: usize, colour: [u8; 3]) -> [u8; 3] {
    let labels = sample.labels();
    let label = labels.data()[i];
    if sample.ignore().data()[i] {
        return colour.map(|c| c / 4);
    }
    if label == 0 {
        return colour;
    }
    let width = labels.width() as usize;
    let edge = [i + 1, i + width]
        .iter()
        .any(|&n| labels.data().get(n).is_some_and(|&other| other != label));
    let hue = label.wrapping_mul(2_654_435_761);
    let tint = [hue >> 24, hue >> 16 & 255, hue >> 8 & 255];
    [0, 1, 2].map(|c: usize| {
        if edge {
            255 - (tint[c] / 3) as u8
        } else {
            ((3 * u32::from(colour[c]) + tint[c]) / 4) as u8
        }
    })
}
