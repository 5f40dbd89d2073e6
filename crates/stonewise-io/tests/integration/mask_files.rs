//! Mask files that are odd, broken or made by our own writers.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use stonewise_core::raster::{LabelImage, Raster};
use stonewise_io::masks::{
    CocoFile, CocoPhoto, InstanceInfo, LabelledPhoto, MaskError, MaskSource, read_label_png, write_label_png,
};

/// A rectangle as a polygon.
fn rectangle(x: f64, y: f64, width: f64, height: f64) -> Value {
    json!([x, y, x + width, y, x + width, y + height, x, y + height])
}

fn annotation(id: u64, polygons: &[Value]) -> Value {
    json!({ "id": id, "image_id": 1, "category_id": 1, "segmentation": polygons })
}

/// A file about one photo of 20 x 10 px.
fn coco(annotations: &[Value]) -> Value {
    json!({
        "images": [{ "id": 1, "file_name": "epoch1/images/0001.jpg", "width": 20, "height": 10 }],
        "categories": [{ "id": 1, "name": "stone" }, { "id": 2, "name": "joint" }],
        "annotations": annotations,
    })
}

fn write(folder: &Path, content: &Value) -> PathBuf {
    let path = folder.join("masks.json");
    std::fs::write(&path, content.to_string()).unwrap();
    path
}

fn labels(content: &Value) -> Result<LabelledPhoto, MaskError> {
    let folder = tempfile::tempdir().unwrap();
    let source = MaskSource::open(&write(folder.path(), content))?;
    Ok(source.labels_for("0001", 20, 10)?.unwrap())
}

fn area(photo: &LabelledPhoto, label: u32) -> usize {
    photo.labels.data().iter().filter(|&&l| l == label).count()
}

#[test]
fn a_small_stone_inside_a_large_outline_survives_in_any_order() {
    let large = annotation(7, &[rectangle(0.0, 0.0, 12.0, 10.0)]);
    let small = annotation(8, &[rectangle(3.0, 3.0, 4.0, 4.0)]);
    let a = labels(&coco(&[large.clone(), small.clone()])).unwrap();
    assert_eq!((area(&a, 1), area(&a, 2)), (104, 16));
    let b = labels(&coco(&[small, large])).unwrap();
    assert_eq!((area(&b, 2), area(&b, 1)), (104, 16));
    assert!(a.warnings.is_empty() && b.warnings.is_empty());
}

#[test]
fn parts_of_an_annotation_are_joined_and_half_a_pixel_does_not_matter() {
    let parts = [
        rectangle(1.0, 1.0, 4.0, 4.0),
        rectangle(3.0, 3.0, 4.0, 4.0),
        rectangle(15.4, 0.4, 2.0, 2.0),
    ];
    let photo = labels(&coco(&[annotation(1, &parts)])).unwrap();
    assert_eq!(area(&photo, 1), 16 + 16 - 4 + 4);
}

#[test]
fn masks_without_a_visible_pixel_are_named() {
    let photo = labels(&coco(&[
        annotation(11, &[rectangle(30.0, 0.0, 5.0, 5.0)]),
        annotation(12, &[json!([1.0, 1.0, 5.0, 5.0])]),
        annotation(13, &[]),
        annotation(14, &[rectangle(2.0, 2.0, 3.0, 3.0)]),
        annotation(15, &[rectangle(2.0, 2.0, 3.0, 3.0)]),
        json!({ "id": 16, "image_id": 1, "segmentation": null }),
        annotation(17, &[rectangle(-5.0, -5.0, 6.0, 6.0)]),
    ]))
    .unwrap();
    let ids: Vec<u32> = photo.instances.iter().map(|info| info.id).collect();
    assert_eq!(ids, [5, 7]);
    assert_eq!((area(&photo, 5), area(&photo, 7)), (9, 1));
    let expected = [
        (11, "no pixel"),
        (12, "no pixel"),
        (13, "no pixel"),
        (16, "no pixel"),
        (14, "hidden"),
    ];
    assert_eq!(photo.warnings.len(), expected.len(), "{:?}", photo.warnings);
    for (warning, (id, reason)) in photo.warnings.iter().zip(expected) {
        let named = warning.contains(&format!("annotation {id} of photo 0001"));
        assert!(named && warning.contains(reason), "{warning}");
    }
}

#[test]
fn only_stones_count_and_extra_keys_are_kept() {
    let mut stone = annotation(1, &[rectangle(0.0, 0.0, 5.0, 5.0)]);
    stone["score"] = json!(0.25);
    stone["stone_id"] = json!(42);
    let mut unknown = annotation(2, &[rectangle(6.0, 0.0, 5.0, 5.0)]);
    unknown["stone_id"] = json!(-1);
    let mut joint = annotation(3, &[rectangle(12.0, 0.0, 5.0, 5.0)]);
    joint["category_id"] = json!(2);
    let photo = labels(&coco(&[stone, unknown, joint])).unwrap();
    let info = |id, score, stone_ref| InstanceInfo { id, score, stone_ref };
    assert_eq!(photo.instances, [info(1, 0.25, Some(42)), info(2, 1.0, None)]);
}

#[test]
fn a_photo_without_masks_is_not_a_photo_that_is_not_listed() {
    let folder = tempfile::tempdir().unwrap();
    let source = MaskSource::open(&write(folder.path(), &coco(&[]))).unwrap();
    let photo = source.labels_for("0001.jpg", 20, 10).unwrap().unwrap();
    assert!(photo.instances.is_empty() && photo.labels.data().iter().all(|&l| l == 0));
    assert_eq!(source.labels_for("0002.jpg", 20, 10).unwrap(), None);
}

#[test]
fn photos_of_the_same_name_are_told_apart_by_folder_or_refused() {
    let mut content = coco(&[]);
    for (id, name) in [(2, "epoch2/images/0001.jpg"), (3, "epoch2/images/0001.png")] {
        let image = json!({ "id": id, "file_name": name, "width": 30, "height": 10 });
        content["images"].as_array_mut().unwrap().push(image);
    }
    let folder = tempfile::tempdir().unwrap();
    let source = MaskSource::open(&write(folder.path(), &content)).unwrap();
    assert!(
        source
            .labels_for("/data/EPOCH1/images/0001.JPG", 20, 10)
            .unwrap()
            .is_some()
    );
    assert!(
        source
            .labels_for("epoch2\\images\\0001.jpg", 30, 10)
            .unwrap()
            .is_some()
    );
    for name in ["0001.jpg", "0001", "epoch2/images/0001"] {
        let error = source.labels_for(name, 20, 10).unwrap_err();
        assert!(matches!(error, MaskError::Ambiguous { .. }), "{name}: {error}");
    }
}

#[test]
fn broken_files_say_where() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("masks.json");
    let open = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let error = MaskSource::open(&path).unwrap_err().to_string();
        assert!(error.contains("masks.json"), "{error}");
        error
    };
    assert!(open("").contains("line 1"));
    assert!(open("{\"images\": [], \"annotations\": []}").contains("lists no image"));
    assert!(open("{\"annotations\": []}").contains("images"));
    let whole = coco(&[annotation(1, &[rectangle(0.0, 0.0, 5.0, 5.0)])]).to_string();
    assert!(open(&whole[..whole.len() / 2]).contains("line 1 column"));
    let missing = MaskSource::open(&folder.path().join("nowhere.json"))
        .unwrap_err()
        .to_string();
    assert!(missing.contains("nowhere.json"));

    let runs = |size: [u32; 2], counts: Value| {
        let annotation =
            json!({ "id": 5, "image_id": 1, "segmentation": { "size": size, "counts": counts } });
        labels(&coco(&[annotation])).unwrap_err().to_string()
    };
    assert!(runs([10, 20], json!([1, 2, 3])).contains("annotation 5: runs cover 6 pixels"));
    assert!(runs([20, 10], json!([0, 200])).contains("runs for 10x20 px in a photo of 20x10 px"));
    assert!(runs([10, 20], json!("\u{1}")).contains("broken compressed runs"));
    let odd = labels(&coco(&[annotation(6, &[json!([1.0, 2.0, 3.0])])]))
        .unwrap_err()
        .to_string();
    assert!(odd.contains("annotation 6: a polygon must be pairs"));
    for odd in [
        json!("polygon"),
        json!([[1.0, "2"]]),
        json!({ "size": [10, 20] }),
        json!(7),
    ] {
        let annotation = json!({ "id": "a7", "image_id": 1, "segmentation": odd });
        let said = labels(&coco(&[annotation])).unwrap_err().to_string();
        assert!(
            said.contains("annotation a7: its segmentation is neither"),
            "{said}"
        );
    }
}

fn remarks(content: &Value) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let source = MaskSource::open(&write(folder.path(), content)).unwrap();
    source.remarks().to_vec()
}

#[test]
fn values_that_other_programs_write_mean_the_same() {
    let usual = coco(&[
        annotation(1, &[rectangle(2.0, 2.0, 3.0, 3.0)]),
        annotation(2, &[rectangle(9.0, 2.0, 3.0, 3.0)]),
    ]);
    let expected = labels(&usual).unwrap();
    assert_eq!(expected.instances.len(), 2);
    assert_eq!(remarks(&usual), [""; 0]);
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut content = usual.clone();
        for annotation in content["annotations"].as_array_mut().unwrap() {
            change(annotation);
        }
        content
    };
    for content in [
        changed(&|a| a["iscrowd"] = json!(false)),
        changed(&|a| a["iscrowd"] = json!(null)),
        changed(&|a| a["segmentation"] = a["segmentation"][0].clone()),
        changed(&|a| a["image_id"] = json!("1")),
        changed(&|a| a["id"] = json!(format!("a{}", a["id"]))),
        changed(&|a| a["category_id"] = json!("1")),
        changed(&|a| a["score"] = json!(null)),
        changed(&|a| a["bbox"] = json!("none")),
    ] {
        assert_eq!(labels(&content).unwrap(), expected, "{content}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("masks.json");
    std::fs::write(&path, format!("\u{feff}{usual}")).unwrap();
    let source = MaskSource::open(&path).unwrap();
    assert_eq!(source.labels_for("0001", 20, 10).unwrap(), Some(expected));
}

#[test]
fn crowds_are_stones_and_said() {
    let mut crowd = annotation(1, &[]);
    // Column by column: rows 2 to 4 of column 3.
    crowd["segmentation"] = json!({ "size": [10, 20], "counts": [32, 3, 165] });
    crowd["iscrowd"] = json!(1);
    let content = coco(&[crowd, annotation(2, &[rectangle(9.0, 2.0, 3.0, 3.0)])]);
    let photo = labels(&content).unwrap();
    assert_eq!((area(&photo, 1), area(&photo, 2)), (3, 9));
    assert!(remarks(&content)[0].contains("1 annotations are marked as crowds"));
}

#[test]
fn categories_are_told_apart_by_the_name_of_the_stones() {
    let mut content = coco(&[
        annotation(1, &[rectangle(2.0, 2.0, 3.0, 3.0)]),
        annotation(2, &[rectangle(0.0, 0.0, 20.0, 10.0)]),
    ]);
    content["annotations"][1]["category_id"] = json!(2);
    let named = |content: &Value, one: &str, other: &str| {
        let mut content = content.clone();
        content["categories"] = json!([{ "id": 1, "name": one }, { "id": 2, "name": other }]);
        content
    };
    for (one, other) in [("stone", "joint"), ("Stones", "mortar")] {
        let photo = labels(&named(&content, one, other)).unwrap();
        assert_eq!((photo.instances.len(), area(&photo, 1)), (1, 9));
        assert!(remarks(&named(&content, one, other))[0].contains(&format!("categories {other:?} (1)")));
    }
    let said = labels(&named(&content, "block", "joint"))
        .unwrap_err()
        .to_string();
    assert!(said.contains("\"block\" (1), \"joint\" (1)"), "{said}");
    // One category is that of the stones, whatever its name.
    content["annotations"].as_array_mut().unwrap().pop();
    assert_eq!(
        labels(&named(&content, "block", "joint"))
            .unwrap()
            .instances
            .len(),
        1
    );
}

#[test]
fn annotations_of_other_images_are_counted() {
    let mut content = coco(&[
        annotation(1, &[rectangle(2.0, 2.0, 3.0, 3.0)]),
        annotation(2, &[rectangle(9.0, 2.0, 3.0, 3.0)]),
    ]);
    content["annotations"][1]["image_id"] = json!(5);
    assert!(
        remarks(&content)[0].contains("1 annotations of images that it does not list, first annotation 2")
    );
}

fn sample() -> LabelImage {
    // A ring with a stone in its hole, two parts that touch at a corner, a stone at the border.
    let rows = [
        "11111000", "12221030", "12421300", "12221000", "11111000", "00000055",
    ];
    let data = rows.concat().bytes().map(|b| u32::from(b - b'0') * 100).collect();
    Raster::from_vec(8, 6, data).unwrap()
}

#[test]
fn written_coco_reads_back_to_the_same_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("masks.json");
    let labels = sample();
    let known = [InstanceInfo {
        id: 300,
        score: 0.5,
        stone_ref: Some(9),
    }];
    let photo = |file_name| CocoPhoto {
        file_name,
        labels: &labels,
        instances: &known,
    };
    let mut file = CocoFile::default();
    for name in ["epoch1/a.jpg", "epoch2/a.jpg"] {
        file.add(&photo(name));
    }
    file.write(&path).unwrap();
    let source = MaskSource::open(&path).unwrap();
    let read = source.labels_for("epoch2/a.jpg", 8, 6).unwrap().unwrap();
    let renumbered: Vec<u32> = read.labels.data().iter().map(|l| l * 100).collect();
    assert_eq!(renumbered, labels.data());
    let third = &read.instances[2];
    assert_eq!((third.score, third.stone_ref), (0.5, Some(9)));
    assert!(read.warnings.is_empty());
}

#[test]
fn label_pngs_read_back_under_each_of_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let labels = sample();
    for name in ["a.png", "b_ids.png", "C_MASK.PNG", "flight 2/a_ids.png"] {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        write_label_png(&path, &labels).unwrap();
        assert_eq!(read_label_png(&path).unwrap(), labels);
    }
    let source = MaskSource::open(folder.path()).unwrap();
    for name in ["images/b.jpg", "B", "c.JPG", "somewhere/flight 2/a.jpg"] {
        let photo = source.labels_for(name, 8, 6).unwrap().unwrap();
        assert_eq!(photo.labels, labels);
        let ids: Vec<u32> = photo.instances.iter().map(|info| info.id).collect();
        assert_eq!(ids, [100, 200, 300, 400, 500]);
    }
    assert_eq!(source.labels_for("d.jpg", 8, 6).unwrap(), None);
    assert!(matches!(
        source.labels_for("a.jpg", 8, 6),
        Err(MaskError::Ambiguous { .. })
    ));
    let error = source.labels_for("b.jpg", 9, 6).unwrap_err().to_string();
    assert!(
        ["b.jpg", "8x6", "9x6", "b_ids.png"]
            .iter()
            .all(|part| error.contains(part)),
        "{error}"
    );
}

#[test]
fn pngs_that_are_no_labels_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(
        MaskSource::open(folder.path()),
        Err(MaskError::Empty { .. })
    ));
    let path = folder.path().join("a.png");
    let refused = |part: &str| {
        let error = read_label_png(&path).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("a.png"), "{error}");
    };
    image::RgbImage::new(3, 2).save(&path).unwrap();
    refused("Rgb8");
    image::GrayAlphaImage::new(3, 2).save(&path).unwrap();
    refused("La8");
    write_label_png(&path, &sample()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
    refused("cannot read the image");
    std::fs::write(&path, "no picture").unwrap();
    refused("cannot read the image");
    let too_large = write_label_png(&path, &Raster::filled(2, 2, 65_536))
        .unwrap_err()
        .to_string();
    assert!(too_large.contains("65536") && too_large.contains("a.png"));
    assert_eq!(std::fs::read(&path).unwrap(), b"no picture");

    let grey = image::GrayImage::from_raw(2, 2, vec![0, 255, 255, 0]).unwrap();
    grey.save(&path).unwrap();
    let source = MaskSource::open(folder.path()).unwrap();
    // Stone or not: parts that touch at a corner alone are two stones.
    let photo = source.labels_for("a.jpg", 2, 2).unwrap().unwrap();
    assert_eq!(photo.labels.data(), [0, 1, 2, 0]);
    assert_eq!(photo.instances.iter().map(|i| i.id).collect::<Vec<_>>(), [1, 2]);
    assert!(photo.warnings[0].contains("one value for all stones, 255") && photo.warnings[0].contains("(2)"));
    let grey = image::GrayImage::from_raw(2, 2, vec![0, 7, 7, 0]).unwrap();
    grey.save(&path).unwrap();
    let photo = source.labels_for("a.jpg", 2, 2).unwrap().unwrap();
    assert_eq!(
        (photo.labels.data(), photo.warnings.len()),
        (&[0, 7, 7, 0][..], 0)
    );
}
