//! Finds a photo by its name.

use stonewise_io::text::composed;

/// Index of the photo with this name. Whole names are compared first, then names without folders, then names
/// without folders and extension; the first comparison that any photo passes decides. Case is ignored, and so is the form of Unicode.
/// `photos`: all names of each photo.
///
/// # Errors
/// No photo or several photos have this name; the message says which.
pub fn photo_named(wanted: &str, photos: &[Vec<String>]) -> Result<usize, String> {
    let plain = |name: &str| composed(name).to_lowercase();
    let target = plain(wanted);
    let forms = [whole, file, stem];
    for form in forms {
        let fits = |names: &Vec<String>| names.iter().any(|n| form(&plain(n)) == form(&target));
        let fitting: Vec<usize> = (0..photos.len()).filter(|&i| fits(&photos[i])).collect();
        match fitting[..] {
            [] => {}
            [one] => return Ok(one),
            _ => {
                return Err(format!(
                    "{} photos are named {wanted:?}: give its folder too",
                    fitting.len()
                ));
            }
        }
    }
    Err(format!("no photo of the epoch is named {wanted:?}"))
}

fn whole(name: &str) -> &str {
    name
}

fn file(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

fn stem(name: &str) -> &str {
    let file = file(name);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_name_decides() {
        let photos = [
            vec!["Left/IMG_1.JPG".to_owned()],
            vec!["right/img_1.jpg".to_owned(), "/data/right/img_1.jpg".to_owned()],
            vec!["img_2".to_owned()],
        ];
        assert_eq!(photo_named("left/img_1.jpg", &photos), Ok(0));
        assert_eq!(photo_named("RIGHT/IMG_1.jpg", &photos), Ok(1));
        assert_eq!(photo_named("img_2.tif", &photos), Ok(2));
        assert!(
            photo_named("img_1.jpg", &photos)
                .unwrap_err()
                .contains("2 photos")
        );
        assert!(
            photo_named("img_3.jpg", &photos)
                .unwrap_err()
                .contains("no photo of the epoch")
        );
    }
}
