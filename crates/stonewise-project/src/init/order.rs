//! Which epoch comes first.

use super::epoch::Found;
use std::path::Path;
use stonewise_io::cloud::{Created, cloud_date};
use stonewise_io::exif::read_exif;
use stonewise_io::image_io::photos_in;
use stonewise_results::calendar::day_of;

/// Words in names of epochs, in order of time.
const WORDS: [&[&str]; 7] = [
    &["before", "after"],
    &["first", "second", "third", "fourth"],
    &["old", "new"],
    &["pre", "post"],
    &["vorher", "nachher"],
    &["erste", "zweite", "dritte", "vierte"],
    &["alt", "neu"],
];

/// The time of an epoch whose files lie below a folder, seconds from 1970; `None` where they do not say it.
type TimeOf = fn(&Path, &Found) -> Option<i64>;

/// Sources of the order where names do not give it, the surest first.
const TIMES: [(TimeOf, &str); 2] = [
    (photo_time, "by the dates of their photos"),
    (
        cloud_time,
        "by the dates in their clouds, of the scan or else of the file: if that is wrong, change the order in the project file",
    ),
];

/// Photos of an epoch whose dates are read.
const DATED_PHOTOS: usize = 5;
/// Day on which GPS time began, counted from 1970.
const GPS_DAY: f64 = 3657.0;
const DAY_S: f64 = 86_400.0;

/// Sorts epochs by time as far as their names or their files give it; returns what gave it. `root`: the folder that
/// their paths are relative to.
pub(super) fn order(root: &Path, epochs: &mut [Found]) -> &'static str {
    let names: Vec<String> = epochs.iter().map(|e| e.name.to_lowercase()).collect();
    if names.iter().all(|n| n.bytes().any(|b| b.is_ascii_digit())) {
        epochs.sort_by_cached_key(|e| pieces(&e.name));
        return "by the numbers in their names";
    }
    let told = WORDS.iter().find(|words| {
        let mut places: Vec<Option<usize>> = names.iter().map(|name| place(name, words)).collect();
        places.sort();
        places.windows(2).all(|pair| pair[0] != pair[1]) && places.first() != Some(&None)
    });
    if let Some(words) = told {
        epochs.sort_by_cached_key(|e| place(&e.name.to_lowercase(), words));
        return "by their names";
    }
    for (time_of, why) in TIMES {
        let mut times: Vec<Option<i64>> = epochs.iter().map(|epoch| time_of(root, epoch)).collect();
        times.sort();
        if times.first() != Some(&None) && times.windows(2).all(|pair| pair[0] != pair[1]) {
            epochs.sort_by_cached_key(|epoch| time_of(root, epoch));
            return why;
        }
    }
    "in alphabetical order, as their names do not tell: if that is wrong, change the order in the project file"
}

/// When the photos of an epoch were taken, by the clock of their camera.
fn photo_time(root: &Path, epoch: &Found) -> Option<i64> {
    let photos = photos_in(&root.join(epoch.images.as_ref()?)).ok()?;
    let dated = photos.iter().take(DATED_PHOTOS);
    let days = dated.filter_map(|photo| day_of(&read_exif(photo)?.taken?));
    days.map(|day| (DAY_S * day) as i64).min()
}

/// When the first of the clouds of an epoch was scanned or written.
fn cloud_time(root: &Path, epoch: &Found) -> Option<i64> {
    let dates = epoch
        .clouds
        .iter()
        .filter_map(|cloud| cloud_date(&root.join(cloud)).ok()?);
    let days = dates.filter_map(|date| match date {
        Created::Day(day) => day_of(&day),
        Created::Gps(seconds) => Some(GPS_DAY + seconds / DAY_S),
    });
    days.map(|day| (DAY_S * day) as i64).min()
}

/// Which of the words a name holds.
fn place(name: &str, words: &[&str]) -> Option<usize> {
    words.iter().position(|word| name.contains(word))
}

/// A name in pieces: text, and numbers by their value, so that epoch 10 follows epoch 9.
fn pieces(name: &str) -> Vec<(String, u64)> {
    let mut pieces = vec![(String::new(), 0u64)];
    let mut is_number = false;
    for c in name.to_lowercase().chars() {
        let last = pieces.len() - 1;
        match c.to_digit(10) {
            Some(digit) => {
                pieces[last].1 = pieces[last].1.saturating_mul(10).saturating_add(u64::from(digit));
                is_number = true;
            }
            None if is_number => {
                pieces.push((c.to_string(), 0));
                is_number = false;
            }
            None => pieces[last].0.push(c),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(names: &[&str]) -> (Vec<String>, &'static str) {
        let named = |name: &&str| Found {
            name: (*name).to_owned(),
            ..Found::default()
        };
        let mut epochs: Vec<Found> = names.iter().map(named).collect();
        let why = order(Path::new(""), &mut epochs);
        (epochs.into_iter().map(|e| e.name).collect(), why)
    }

    #[test]
    fn words_and_numbers_tell_the_order_and_else_it_is_said() {
        assert_eq!(ordered(&["after", "before"]).0, ["before", "after"]);
        assert_eq!(ordered(&["Wand neu", "wand_alt"]).0, ["wand_alt", "Wand neu"]);
        assert_eq!(ordered(&["epoch10", "epoch9"]).0, ["epoch9", "epoch10"]);
        assert_eq!(
            ordered(&["2024-10-01", "2024-9-30", "2023"]).0,
            ["2023", "2024-9-30", "2024-10-01"]
        );
        let (names, why) = ordered(&["company a", "company b"]);
        assert_eq!(names, ["company a", "company b"]);
        assert!(why.contains("change the order"));
    }

    /// A JPEG without a picture that was taken then.
    fn photo(date: &str) -> Vec<u8> {
        // One entry, `DateTime`, whose text follows the directory.
        let mut tiff = b"II*\0\x08\0\0\0\x01\0\x32\x01\x02\0\x14\0\0\0\x1a\0\0\0\0\0\0\0".to_vec();
        tiff.extend(date.bytes().chain([0]));
        let mut bytes = b"\xff\xd8\xff\xe1".to_vec();
        bytes.extend((tiff.len() as u16 + 8).to_be_bytes());
        bytes.extend(b"Exif\0\0");
        bytes.extend(tiff);
        bytes
    }

    #[test]
    fn dates_of_files_tell_the_order_where_names_do_not() {
        let dir = tempfile::tempdir().unwrap();
        let found = |(name, date): (&str, &str)| {
            let images = dir.path().join(name);
            std::fs::create_dir(&images).unwrap();
            std::fs::write(images.join("1.jpg"), photo(date)).unwrap();
            Found {
                name: name.to_owned(),
                images: Some(name.into()),
                ..Found::default()
            }
        };
        let taken = [("north", "2025:04:12 09:31:02"), ("south", "2024:11:02 10:00:00")];
        let mut epochs = taken.map(found);
        assert_eq!(order(dir.path(), &mut epochs), "by the dates of their photos");
        assert_eq!(epochs.map(|e| e.name), ["south", "north"]);

        // The day of the year and the year are bytes 90 to 93 of the header of a LAS file.
        let cloud = |(name, year): (&str, u16)| {
            let file = format!("{name}.las");
            let path = dir.path().join(&file);
            stonewise_io::cloud::write_points_laz(&path, None, &[nalgebra::Point3::origin()], &[]).unwrap();
            let mut bytes = std::fs::read(&path).unwrap();
            bytes[90..92].copy_from_slice(&100u16.to_le_bytes());
            bytes[92..94].copy_from_slice(&year.to_le_bytes());
            std::fs::write(&path, bytes).unwrap();
            Found {
                name: name.to_owned(),
                clouds: vec![file.into()],
                ..Found::default()
            }
        };
        let mut epochs = [("company a", 2025), ("company b", 2023)].map(cloud);
        assert!(order(dir.path(), &mut epochs).starts_with("by the dates in their clouds"));
        assert_eq!(epochs.map(|e| e.name), ["company b", "company a"]);
    }
}
