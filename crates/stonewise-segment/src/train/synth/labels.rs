//! From labels on the canvas to the stones of a sample: only what a person would outline.

use super::canvas::Canvas;
use stonewise_core::raster::{LabelImage, Raster, connected_components};

/// Fewest visible pixels of a stone that is worth outlining.
const MIN_AREA_PX: u32 = 40;
/// Least thickness of a stone, pixels: twice its area over its perimeter, which is half the side of a square.
const MIN_THICKNESS_PX: f32 = 2.6;
/// Parts of a stone smaller than this share of it, cut off by something in front, are doubtful.
const MIN_PART_SHARE: f32 = 0.1;

/// Labels 1, 2, ... without gaps in reading order, and where the truth is doubtful: stones that are too small
/// or thin to be seen through the blur, bits cut off from a stone, and what the canvas says.
pub(super) fn finish(canvas: &Canvas, blur_px: f32, width: u32, height: u32) -> (LabelImage, Raster<bool>) {
    let mut labels: LabelImage = Raster::filled(width, height, 0);
    let mut doubt = Raster::filled(width, height, false);
    for y in 0..height {
        for x in 0..width {
            let sample =
                |pixel: u32, count: usize| (((pixel as f32 + 0.5) * canvas.scale) as usize).min(count - 1);
            let from = sample(y, canvas.height) * canvas.width + sample(x, canvas.width);
            let to = (y * width + x) as usize;
            labels.data_mut()[to] = canvas.label[from];
            doubt.data_mut()[to] = canvas.doubtful[from];
        }
    }

    let (numbers, parts) = connected_components(&labels);
    let mut areas = vec![0; canvas.stones as usize + 1];
    for part in &parts {
        areas[part.label as usize] += part.area;
    }
    let perimeters = perimeters(&numbers, parts.len());
    let kept: Vec<bool> = parts
        .iter()
        .zip(&perimeters[1..])
        .map(|(part, &perimeter)| {
            let thickness = 2.0 * part.area as f32 / perimeter.max(1) as f32;
            part.area >= MIN_AREA_PX
                && thickness >= MIN_THICKNESS_PX.max(2.5 * blur_px)
                && part.area as f32 >= MIN_PART_SHARE * areas[part.label as usize] as f32
        })
        .collect();

    let mut compact = vec![0; areas.len()];
    let mut count = 0;
    for ((label, doubt), &number) in labels
        .data_mut()
        .iter_mut()
        .zip(doubt.data_mut())
        .zip(numbers.data())
    {
        if number == 0 {
            continue;
        }
        if !kept[number as usize - 1] {
            *label = 0;
            *doubt = true;
            continue;
        }
        let name = &mut compact[*label as usize];
        if *name == 0 {
            count += 1;
            *name = count;
        }
        *label = *name;
    }

    (labels, doubt)
}

/// Number of pixel sides on the outline of each part; sides on the image's border do not count.
fn perimeters(numbers: &LabelImage, parts: usize) -> Vec<u32> {
    let (width, height) = (numbers.width() as usize, numbers.height() as usize);
    let data = numbers.data();
    let mut sides = vec![0; parts + 1];
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            for other in [
                (x + 1 < width).then_some(i + 1),
                (y + 1 < height).then_some(i + width),
            ] {
                if let Some(other) = other
                    && data[i] != data[other]
                {
                    sides[data[i] as usize] += 1;
                    sides[data[other] as usize] += 1;
                }
            }
        }
    }
    sides
}
