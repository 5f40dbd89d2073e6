//! Tables with a description of their columns.

use std::path::Path;

/// Checks that the metadata beside a CSV file describe the columns of its header, in their order.
pub fn check_csv_metadata(csv: &Path) {
    let header = std::fs::read_to_string(csv).unwrap();
    let name = csv.file_name().unwrap().to_string_lossy().into_owned();
    let metadata = std::fs::read(csv.with_file_name(format!("{name}-metadata.json"))).unwrap();
    let document: serde_json::Value = serde_json::from_slice(&metadata).unwrap();
    assert_eq!(document["url"], name.as_str());
    let columns = document["tableSchema"]["columns"].as_array().unwrap();
    let names: Vec<&str> = columns.iter().filter_map(|c| c["name"].as_str()).collect();
    let expected: Vec<&str> = header.lines().next().unwrap().split(',').collect();
    assert_eq!(names, expected);
    for column in columns {
        let meaning = column["dc:description"].as_str().unwrap();
        assert!(!meaning.is_empty(), "{column}");
    }
}
