//! What a half is called; 0 is the first, 1 the second.

/// Name of its epoch.
pub(super) fn half_name(half: usize) -> String {
    format!("half {}", half + 1)
}

/// Its folder, relative to the new project.
pub(super) fn half_folder(half: usize) -> String {
    format!("half{}", half + 1)
}
