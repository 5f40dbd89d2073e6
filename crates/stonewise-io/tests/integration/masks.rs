//! Mask files of the sample surveys.

use std::collections::BTreeMap;
use stonewise_io::image_io::image_size;
use stonewise_io::masks::MaskSource;
use stonewise_testing::survey;

#[test]
fn coco_and_label_png_of_the_dam_are_the_same_pixels() {
    let Some(folder) = survey("dam_small/combo") else {
        return;
    };
    let masks = folder.join("truth/masks");
    let coco = MaskSource::open(&masks.join("epoch1_coco.json")).unwrap();
    let png = MaskSource::open(&masks.join("epoch1")).unwrap();
    let photos: Vec<_> = std::fs::read_dir(folder.join("epoch1/images")).unwrap().collect();
    assert_eq!(photos.len(), 6);
    for photo in photos {
        let path = photo.unwrap().path();
        let (width, height) = image_size(&path).unwrap();
        // The whole path, as the pipeline passes it.
        let name = path.to_string_lossy();
        let a = coco.labels_for(&name, width, height).unwrap().unwrap();
        let b = png.labels_for(&name, width, height).unwrap().unwrap();
        assert!(a.warnings.is_empty() && b.warnings.is_empty());
        let stones: BTreeMap<u32, u32> = a
            .instances
            .iter()
            .map(|info| (info.id, info.stone_ref.unwrap() as u32))
            .chain([(0, 0)])
            .collect();
        let mut areas: BTreeMap<u32, usize> = BTreeMap::new();
        for &stone in b.labels.data() {
            *areas.entry(stone).or_default() += 1;
        }
        // The survey's COCO file leaves out stones that show under 60 pixels.
        let listed = |stone: u32| if areas[&stone] < 60 { 0 } else { stone };
        let translated = a.labels.data().iter().map(|id| stones[id]);
        let expected = b.labels.data().iter().map(|&stone| listed(stone));
        assert!(translated.eq(expected), "{name}");
    }
}

#[test]
fn fountain_masks_are_found_by_stem_and_by_path() {
    let Some(folder) = survey("masks_real/fountain") else {
        return;
    };
    let masks = MaskSource::open(&folder.join("instances.json")).unwrap();
    let mut instances = 0;
    for i in 0..11 {
        // As Metashape labels it, without extension.
        let name = format!("{i:04}");
        let photo = masks.labels_for(&name, 3072, 2048).unwrap().unwrap();
        let warned = photo.warnings.len();
        assert!(warned <= 2, "{:?}", photo.warnings);
        instances += photo.instances.len();
        let labelled = photo.labels.data().iter().filter(|&&l| l != 0).count();
        assert!(labelled > 500_000, "{name}: {labelled}");
        assert!(
            photo
                .instances
                .iter()
                .filter(|info| info.stone_ref.is_some())
                .count()
                > 50
        );
        let by_path = masks.labels_for(
            &format!("/somewhere/epoch{}/images/{name}.jpg", 1 + i % 2),
            3072,
            2048,
        );
        assert_eq!(by_path.unwrap().unwrap(), photo);
    }
    assert!((1410..=1419).contains(&instances), "{instances}");
    assert!(masks.labels_for("0011.jpg", 3072, 2048).unwrap().is_none());
    let error = masks.labels_for("0003.jpg", 1536, 1024).unwrap_err().to_string();
    for part in ["0003.jpg", "3072x2048", "1536x1024", "instances.json"] {
        assert!(error.contains(part), "{error}");
    }
}
