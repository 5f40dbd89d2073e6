//! Photo crops of stones, rectified to their faces, side by side in a few pictures.

use super::atlas::{Atlas, per_row};
use super::files::{make_dir, metadata_number, path, read_table};
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_io::table::{Table, write_parquet};

/// Pixels of all crops of an epoch: at JPEG's 0.15 bytes a pixel, 6 MB.
const BUDGET_PX: f64 = 40e6;
/// Smallest and largest edge of a crop, pixels. Multiples of 16, see [`Atlas`].
const SIDE_PX: [u32; 2] = [64, 208];
/// Stem of the files.
const STEM: &str = "crops";
/// Keys of the table's metadata.
const SIDE: &str = "side_px";
const PER_ROW: &str = "per_row";

/// A crop: a square window on the plane of the stone's face around its centroid in the first epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Crop {
    /// Stone of the first epoch.
    pub stone_id: u32,
    /// Name of the photo's camera.
    pub photo: String,
    /// Half the edge of the window, metres. Right is along the wall, up is up the face.
    pub half_m: f64,
    /// Outlines of the stone's mask in this photo, pixels of the crop; empty where the photo's masks do not
    /// show it.
    pub rings: Vec<Vec<[f32; 2]>>,
}

/// Crops as they lie in the folder.
#[derive(Clone, Debug)]
pub struct StoredCrops {
    pub side_px: u32,
    /// Crops in a row of a picture; as many rows.
    pub per_row: u32,
    /// In the order of their places in the pictures.
    pub crops: Vec<Crop>,
    /// The pictures, as JPEG files.
    pub pictures: Vec<Vec<u8>>,
}

/// Edge of the crops of this many stones whose photos are worth `wanted_px`, pixels.
pub fn crop_side_px(stones: usize, wanted_px: f64) -> u32 {
    let affordable = (BUDGET_PX / stones.max(1) as f64).sqrt().min(wanted_px);
    let steps = (affordable / 16.0).floor() as u32 * 16;
    steps.clamp(SIDE_PX[0], SIDE_PX[1])
}

/// Writes `evidence/crops_E.parquet`, `evidence/crop_outlines_E.parquet` and the pictures
/// `evidence/crops_E_NNN.jpg`.
///
/// `tiles`: the pixels of each crop, row by row, `side_px` squared.
///
/// # Errors
/// A file cannot be written.
pub fn write_crops(
    dir: &Path,
    epoch: usize,
    side_px: u32,
    crops: &[Crop],
    tiles: &[Vec<[u8; 3]>],
) -> Result<(), Error> {
    make_dir(dir)?;
    let atlas = Atlas {
        dir,
        stem: STEM,
        epoch,
        side_px,
        per_row: per_row(side_px, crops.len()),
    };
    let mut table = Table::new();
    let stones: Vec<u32> = crops.iter().map(|c| c.stone_id).collect();
    table.push("stone_id", "", "number of the stone", stones)?;
    let photos: Vec<String> = crops.iter().map(|c| c.photo.clone()).collect();
    table.push("photo", "", "name of the photo", photos)?;
    table.push(
        "half_m",
        "m",
        "half the edge of the crop on the plane of the stone's face",
        crops.iter().map(|c| c.half_m).collect::<Vec<f64>>(),
    )?;

    table.set_metadata(SIDE, side_px.to_string());
    table.set_metadata(PER_ROW, atlas.per_row.to_string());
    write_outlines(&path(dir, "crop_outlines", epoch, "parquet"), crops)?;
    atlas.write(tiles)?;
    Ok(write_parquet(&path(dir, STEM, epoch, "parquet"), &table)?)
}

fn write_outlines(path: &Path, crops: &[Crop]) -> Result<(), Error> {
    let (mut stone, mut ring, mut x, mut y) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for crop in crops {
        for (number, vertices) in crop.rings.iter().enumerate() {
            stone.extend(std::iter::repeat_n(crop.stone_id, vertices.len()));
            ring.extend(std::iter::repeat_n(number as u32, vertices.len()));
            x.extend(vertices.iter().map(|v| v[0]));
            y.extend(vertices.iter().map(|v| v[1]));
        }
    }
    let mut table = Table::new();
    table.push("stone_id", "", "number of the stone", stone)?;
    table.push("ring", "", "number of the ring, from 0", ring)?;
    table.push("x_px", "px", "vertex, to the right from the crop's left edge", x)?;
    table.push("y_px", "px", "vertex, down from the crop's upper edge", y)?;
    Ok(write_parquet(path, &table)?)
}

/// Reads it all back; `None` where there are no crops.
pub(super) fn read_crops(dir: &Path, epoch: usize) -> Result<Option<StoredCrops>, Error> {
    let list = path(dir, STEM, epoch, "parquet");
    let Some(table) = read_table(&list)? else {
        return Ok(None);
    };
    let (side_px, per_row) = (
        metadata_number(&table, SIDE, &list)?,
        metadata_number(&table, PER_ROW, &list)?,
    );
    let (stone, photo, half) = (
        table.required::<u32>("stone_id")?,
        table.required::<String>("photo")?,
        table.required::<f64>("half_m")?,
    );
    let mut crops: Vec<Crop> = (0..table.rows())
        .map(|i| Crop {
            stone_id: stone[i],
            photo: photo[i].clone(),
            half_m: half[i],
            rings: Vec::new(),
        })
        .collect();

    read_outlines(&path(dir, "crop_outlines", epoch, "parquet"), &mut crops)?;
    let atlas = Atlas {
        dir,
        stem: STEM,
        epoch,
        side_px,
        per_row,
    };
    let pictures = atlas.read(crops.len())?;

    Ok(Some(StoredCrops {
        side_px,
        per_row,
        crops,
        pictures,
    }))
}

/// Gives the crops their outlines; rows lie in the order of the crops.
fn read_outlines(path: &Path, crops: &mut [Crop]) -> Result<(), Error> {
    let Some(table) = read_table(path)? else {
        return Ok(());
    };
    let (stone, ring) = (table.required::<u32>("stone_id")?, table.required::<u32>("ring")?);
    let (x, y) = (table.required::<f32>("x_px")?, table.required::<f32>("y_px")?);
    let places: std::collections::BTreeMap<u32, usize> =
        crops.iter().enumerate().map(|(i, c)| (c.stone_id, i)).collect();
    for row in 0..table.rows() {
        let Some(&i) = places.get(&stone[row]) else {
            continue;
        };
        let rings = &mut crops[i].rings;
        rings.resize(rings.len().max(ring[row] as usize + 1), Vec::new());
        rings[ring[row] as usize].push([x[row], y[row]]);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_shrink_with_their_number_but_stay_readable() {
        assert_eq!(crop_side_px(200, 1000.0), 208);
        assert_eq!(crop_side_px(200, 100.0), 96);
        assert_eq!(crop_side_px(10_000, 1000.0), 64);
        assert_eq!(crop_side_px(0, 0.0), 64);
    }

    #[test]
    fn crops_come_back_with_their_outlines_and_places() {
        let folder = tempfile::tempdir().unwrap();
        let crop = |i: u32| Crop {
            stone_id: 10 + i,
            photo: format!("<{i}>.jpg"),
            half_m: 0.25,
            rings: if i == 1 {
                vec![vec![[1.0, 2.0], [3.0, 2.0], [3.0, 5.5]], vec![[9.0, 9.0]; 3]]
            } else {
                vec![]
            },
        };
        let crops: Vec<Crop> = (0..5).map(crop).collect();
        let tiles: Vec<Vec<[u8; 3]>> = (0..5).map(|i| vec![[i * 50, 0, 0]; 64 * 64]).collect();
        write_crops(folder.path(), 1, 64, &crops, &tiles).unwrap();
        let back = read_crops(folder.path(), 1).unwrap().unwrap();
        assert_eq!(back.crops, crops);
        assert_eq!((back.side_px, back.per_row, back.pictures.len()), (64, 3, 1));
        let picture =
            stonewise_io::image_io::read_rgb(&folder.path().join("data/evidence/crops_1_000.jpg")).unwrap();
        assert_eq!((picture.width(), picture.height()), (192, 128));
        // The fifth crop is the second of the second row.
        let middle = picture.get(96, 96).unwrap();
        assert!(middle[0].abs_diff(200) < 6, "{middle:?}");
        assert!(read_crops(folder.path(), 2).unwrap().is_none());
    }
}
