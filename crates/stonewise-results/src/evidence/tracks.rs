//! What clouds and photos say of the stones that were tracked in photos, each by itself, with pictures of
//! what was matched.

use super::atlas::{Atlas, per_row};
use super::files::{make_dir, metadata_number, path, read_table};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::registration::photos::FacePictures;
use stonewise_core::registration::{FaceShift, PhotoShift, StoneEvidence};
use stonewise_io::table::{Table, TableError, write_parquet};

/// Pixels of all pictures: at 0.16 bytes a pixel of a JPEG, 2 MB.
const BUDGET_PX: usize = 12_000_000;
/// Edges of a picture, pixels: that of a brick in photos of 4 mm a pixel, down to what still shows a stain.
/// Multiples of 16, see [`Atlas`].
const SIDES_PX: [u32; 3] = [64, 48, 32];
/// Pictures of a stone: of the first epoch, of the later one, their difference.
const PICTURES: usize = 3;
/// Stem of the files.
const STEM: &str = "tracks";
/// Keys of the table's metadata.
const SIDE: &str = "side_px";
const PER_ROW: &str = "per_row";

/// The tracked stones of a pair of epochs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tracks {
    /// Names of the photos of both epochs, as the stones count them.
    pub photos: Vec<String>,
    /// Stones of the first epoch, ascending, with what is known of them in the frame of their face.
    pub stones: Vec<(u32, StoneEvidence)>,
}

/// Tracked stones as they lie in the folder.
#[derive(Clone, Debug, Default)]
pub struct StoredTracks {
    pub tracks: Tracks,
    pub side_px: u32,
    /// Pictures in a row of a large picture; as many rows. Three for each stone that has pictures.
    pub per_row: u32,
    /// The large pictures, as JPEG files.
    pub pictures: Vec<Vec<u8>>,
}

/// Edge of the pictures of this many tracked stones, pixels.
pub fn track_side_px(stones: usize) -> u32 {
    let fits = |side: &&u32| pixels(**side) * stones <= BUDGET_PX;
    *SIDES_PX.iter().find(fits).unwrap_or(&SIDES_PX[2])
}

/// Stones of which the folder holds pictures of this edge, at most.
pub fn most_pictured(side_px: u32) -> usize {
    BUDGET_PX / pixels(side_px).max(1)
}

fn pixels(side_px: u32) -> usize {
    PICTURES * (side_px * side_px) as usize
}

/// Writes `evidence/tracks_E.parquet`, `evidence/track_shifts_E.parquet` and the pictures
/// `evidence/tracks_E_NNN.jpg` of epoch `later` against the first. All pictures have one size.
///
/// # Errors
/// A file cannot be written.
pub fn write_tracks(dir: &Path, later: usize, tracks: &Tracks) -> Result<(), Error> {
    make_dir(dir)?;
    let pictures: Vec<&FacePictures> = tracks
        .stones
        .iter()
        .filter_map(|(_, s)| s.pictures.as_ref())
        .collect();
    let tiles: Vec<Vec<[u8; 3]>> = pictures.iter().flat_map(|p| tiles(p)).collect();
    let side_px = pictures.first().map_or(SIDES_PX[0], |p| p.side_px as u32);
    let atlas = Atlas {
        dir,
        stem: STEM,
        epoch: later,
        side_px,
        per_row: per_row(side_px, tiles.len()),
    };
    atlas.write(&tiles)?;
    write_shifts(dir, later, tracks)?;
    let mut table = stone_table(tracks)?;
    table.set_metadata(SIDE, atlas.side_px.to_string());
    table.set_metadata(PER_ROW, atlas.per_row.to_string());
    Ok(write_parquet(&path(dir, STEM, later, "parquet"), &table)?)
}

fn tiles(pictures: &FacePictures) -> [Vec<[u8; 3]>; PICTURES] {
    let [first, later] = &pictures.grey;
    [first, later, &pictures.difference].map(|grey| grey.iter().map(|g| [*g; 3]).collect())
}

/// One of the displacements of a stone.
type ShiftOf = fn(&StoneEvidence) -> Option<FaceShift>;

/// One row for each stone.
fn stone_table(tracks: &Tracks) -> Result<Table, TableError> {
    let stones = &tracks.stones;
    let mut table = Table::new();
    let ids: Vec<u32> = stones.iter().map(|(id, _)| *id).collect();
    table.push("stone_id", "", "number of the stone", ids)?;

    for (axis, name) in ["along", "up"].into_iter().enumerate() {
        let place: Vec<f64> = stones.iter().map(|(_, s)| s.place[axis]).collect();
        let meaning = format!("place on the face whose displacement is given, {name}, from the centroid");
        table.push(&format!("place_{name}"), "m", &meaning, place)?;
    }

    let by: [(&str, &str, ShiftOf); 3] = [
        ("clouds", "the stone's own points alone", |s| s.clouds),
        (
            "photos",
            "the photos alone, appearance bias included, errors of the poses not",
            |s| s.photos,
        ),
        (
            "both",
            "both and the neighbours, without errors of the epochs' registration",
            |s| s.both,
        ),
    ];

    for (stem, whose, of) in by {
        let shifts: Vec<Option<FaceShift>> = stones.iter().map(|(_, s)| of(s)).collect();
        push_shift(&mut table, stem, whose, &shifts)?;
    }

    for epoch in [0, 1] {
        let name = |s: &StoneEvidence| tracks.photos.get(s.pictures.as_ref()?.photos[epoch]).cloned();
        let names: Vec<Option<String>> = stones.iter().map(|(_, s)| name(s)).collect();
        let meaning = "photo of the stone's picture; empty where there is none";
        table.push(&format!("photo_{}", epoch + 1), "", meaning, names)?;
    }

    let edges: Vec<Option<f64>> = stones
        .iter()
        .map(|(_, s)| s.pictures.as_ref().map(|p| p.edge_m))
        .collect();
    table.push(
        "edge_m",
        "m",
        "edge of the pictures on the plane of the stone's face",
        edges,
    )?;
    Ok(table)
}

/// The columns of a displacement in the face.
fn push_shift(
    table: &mut Table,
    stem: &str,
    whose: &str,
    shifts: &[Option<FaceShift>],
) -> Result<(), TableError> {
    let column = |value: &dyn Fn(&FaceShift) -> f64| -> Vec<Option<f64>> {
        shifts.iter().map(|s| s.as_ref().map(value)).collect()
    };

    for (axis, name) in ["along", "up"].into_iter().enumerate() {
        let meaning = format!("displacement {name} by {whose}");
        table.push(
            &format!("{stem}_{name}"),
            "m",
            &meaning,
            column(&|s| s.shift_m[axis]),
        )?;
    }

    let terms = [
        ("along_along", "along"),
        ("along_up", "along and up"),
        ("up_up", "up"),
    ];

    for (k, (name, of)) in terms.into_iter().enumerate() {
        let meaning = format!("covariance of the displacement {of} by {whose}");
        table.push(
            &format!("{stem}_cov_{name}"),
            "m2",
            &meaning,
            column(&|s| s.covariance_m2[k]),
        )?;
    }

    Ok(())
}

/// One row for each stone and photo.
fn write_shifts(dir: &Path, later: usize, tracks: &Tracks) -> Result<(), Error> {
    let all: Vec<(u32, &PhotoShift)> = tracks
        .stones
        .iter()
        .flat_map(|(id, s)| s.shifts.iter().map(|shift| (*id, shift)))
        .collect();
    let mut table = Table::new();
    let ids: Vec<u32> = all.iter().map(|(id, _)| *id).collect();
    table.push("stone_id", "", "number of the stone", ids)?;
    let name = |s: &PhotoShift| tracks.photos.get(s.photo).cloned().unwrap_or_default();
    let names: Vec<String> = all.iter().map(|(_, s)| name(s)).collect();
    table.push("photo", "", "name of the photo", names)?;
    let is_later: Vec<bool> = all.iter().map(|(_, s)| s.epoch == 1).collect();
    table.push("later", "", "whether the photo is of the later epoch", is_later)?;
    let shifts: Vec<Option<FaceShift>> = all.iter().map(|(_, s)| Some(s.shift)).collect();
    let whose = "this photo, its pose and the height of the face adjusted; about zero in the first epoch";
    push_shift(&mut table, "shift", whose, &shifts)?;
    let weights: Vec<f64> = all.iter().map(|(_, s)| s.weight).collect();
    table.push(
        "weight",
        "",
        "weight of the photo, small where it contradicts the others",
        weights,
    )?;
    Ok(write_parquet(
        &path(dir, "track_shifts", later, "parquet"),
        &table,
    )?)
}

/// Reads it all back, without the pixels; `None` where nothing was tracked.
pub(super) fn read_tracks(dir: &Path, later: usize) -> Result<Option<StoredTracks>, Error> {
    let list = path(dir, STEM, later, "parquet");
    let Some(table) = read_table(&list)? else {
        return Ok(None);
    };
    let (side_px, per_row) = (
        metadata_number(&table, SIDE, &list)?,
        metadata_number(&table, PER_ROW, &list)?,
    );
    let mut names = Names::default();
    let mut shifts = read_shifts(dir, later, &mut names)?;
    let ids = table.required::<u32>("stone_id")?;
    let places = [
        table.required::<f64>("place_along")?,
        table.required::<f64>("place_up")?,
    ];

    let (clouds, photos) = (shift_columns(&table, "clouds")?, shift_columns(&table, "photos")?);
    let shown = [
        table.optional::<String>("photo_1")?,
        table.optional::<String>("photo_2")?,
    ];
    let both = shift_columns(&table, "both")?;
    let edges = table.optional::<f64>("edge_m")?;

    let mut pictures = |i: usize| -> Option<FacePictures> {
        Some(FacePictures {
            edge_m: edges[i]?,
            photos: [
                names.number(shown[0][i].as_ref()?),
                names.number(shown[1][i].as_ref()?),
            ],
            side_px: side_px as usize,
            grey: [Vec::new(), Vec::new()],
            difference: Vec::new(),
        })
    };

    let stones: Vec<(u32, StoneEvidence)> = (0..table.rows())
        .map(|i| {
            let evidence = StoneEvidence {
                place: [places[0][i], places[1][i]],
                clouds: clouds[i],
                photos: photos[i],
                both: both[i],
                shifts: shifts.remove(&ids[i]).unwrap_or_default(),
                pictures: pictures(i),
            };
            (ids[i], evidence)
        })
        .collect();
    let atlas = Atlas {
        dir,
        stem: STEM,
        epoch: later,
        side_px,
        per_row,
    };

    let pictured = stones.iter().filter(|(_, s)| s.pictures.is_some()).count();
    Ok(Some(StoredTracks {
        tracks: Tracks {
            photos: names.list,
            stones,
        },
        side_px,
        per_row,
        pictures: atlas.read(PICTURES * pictured)?,
    }))
}

/// Names by the order in which they appear.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    numbers: BTreeMap<String, usize>,
}

impl Names {
    fn number(&mut self, name: &str) -> usize {
        let next = self.list.len();
        *self.numbers.entry(name.to_owned()).or_insert_with(|| {
            self.list.push(name.to_owned());
            next
        })
    }
}

fn read_shifts(dir: &Path, later: usize, names: &mut Names) -> Result<BTreeMap<u32, Vec<PhotoShift>>, Error> {
    let mut by_stone: BTreeMap<u32, Vec<PhotoShift>> = BTreeMap::new();
    let Some(table) = read_table(&path(dir, "track_shifts", later, "parquet"))? else {
        return Ok(by_stone);
    };
    let (ids, photos) = (
        table.required::<u32>("stone_id")?,
        table.required::<String>("photo")?,
    );
    let (is_later, weights) = (table.required::<bool>("later")?, table.required::<f64>("weight")?);
    for (i, shift) in shift_columns(&table, "shift")?.into_iter().enumerate() {
        let Some(shift) = shift else { continue };
        by_stone.entry(ids[i]).or_default().push(PhotoShift {
            photo: names.number(&photos[i]),
            epoch: usize::from(is_later[i]),
            shift,
            weight: weights[i],
        });
    }
    Ok(by_stone)
}

fn shift_columns(table: &Table, stem: &str) -> Result<Vec<Option<FaceShift>>, TableError> {
    let column = |name: &str| table.optional::<f64>(&format!("{stem}_{name}"));
    let (along, up) = (column("along")?, column("up")?);
    let terms = [
        column("cov_along_along")?,
        column("cov_along_up")?,
        column("cov_up_up")?,
    ];
    let shift = |i: usize| {
        Some(FaceShift {
            shift_m: [along[i]?, up[i]?],
            covariance_m2: [terms[0][i]?, terms[1][i]?, terms[2][i]?],
        })
    };
    Ok((0..table.rows()).map(shift).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shift(size: f64) -> FaceShift {
        FaceShift {
            shift_m: [size, -size],
            covariance_m2: [4e-6, 1e-6, 9e-6],
        }
    }

    fn evidence(pictures: Option<FacePictures>) -> StoneEvidence {
        let photo = |photo: usize, epoch: usize| PhotoShift {
            photo,
            epoch,
            shift: shift(0.001 * photo as f64),
            weight: 0.5,
        };
        StoneEvidence {
            place: [0.01, -0.02],
            clouds: Some(shift(0.003)),
            photos: pictures.is_none().then_some(shift(0.004)),
            both: Some(shift(0.005)),
            shifts: vec![photo(0, 0), photo(1, 1)],
            pictures,
        }
    }

    #[test]
    fn tracked_stones_come_back_with_the_places_of_their_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let side_px = 32;
        let pictures = FacePictures {
            photos: [0, 1],
            side_px,
            edge_m: 0.3,
            grey: [vec![40; side_px * side_px], vec![200; side_px * side_px]],
            difference: vec![128; side_px * side_px],
        };
        let tracks = Tracks {
            photos: vec!["<a>.jpg".to_owned(), "b.jpg".to_owned()],
            stones: vec![(7, evidence(None)), (9, evidence(Some(pictures)))],
        };
        write_tracks(folder.path(), 2, &tracks).unwrap();
        let back = read_tracks(folder.path(), 2).unwrap().unwrap();
        let mut expected = tracks.clone();
        if let Some(pictures) = expected.stones[1].1.pictures.as_mut() {
            // Pixels stay in the picture.
            (pictures.grey, pictures.difference) = Default::default();
        }
        assert_eq!(back.tracks, expected);
        assert_eq!((back.side_px, back.per_row, back.pictures.len()), (32, 2, 1));
        let atlas = folder.path().join("data/evidence/tracks_2_000.jpg");
        let picture = stonewise_io::image_io::read_rgb(&atlas).unwrap();
        for (x, y, grey) in [(16, 16, 40), (48, 16, 200), (16, 48, 128)] {
            assert!(picture.get(x, y).unwrap()[0].abs_diff(grey) < 4, "{x} {y}");
        }
        assert!(read_tracks(folder.path(), 3).unwrap().is_none());
    }

    #[test]
    fn pictures_stay_within_the_budget() {
        for stones in [0, 79, 976, 977, 1736, 3907, 16_000] {
            let side_px = track_side_px(stones);
            let shown = stones.min(most_pictured(side_px));
            assert!(pixels(side_px) * shown <= BUDGET_PX, "{stones}");
            assert!(shown == stones || side_px == 32, "{stones}");
        }
        assert_eq!([200, 1500, 16_000].map(track_side_px), [64, 48, 32]);
    }
}
