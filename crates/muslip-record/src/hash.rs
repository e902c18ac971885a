//! A number that changes with the wire types.

/// FNV-1a over the source of the wire types, without comments and white space.
///
/// Any change of a name, a type or an order changes it; a change of words does not. It errs on the safe
/// side: two sources that mean the same may differ.
pub const SCHEMA_HASH: u32 = {
    let hash = fold(0x811c_9dc5, include_bytes!("wire.rs"));
    let hash = fold(hash, include_bytes!("parameters.rs"));
    fold(hash, include_bytes!("compensation.rs"))
};

/// The same over the parameters alone: what a controller stores with them, so that another layout is not read as this.
pub const PARAMETERS_HASH: u32 = {
    let hash = fold(0x811c_9dc5, include_bytes!("parameters.rs"));
    fold(hash, include_bytes!("compensation.rs"))
};

#[expect(
    clippy::indexing_slicing,
    reason = "evaluated at compile time only, where an index out of range stops the build"
)]
const fn fold(mut hash: u32, source: &[u8]) -> u32 {
    let mut at = 0;
    while at < source.len() {
        let byte = source[at];
        if byte == b'/' && at + 1 < source.len() && source[at + 1] == b'/' {
            while at < source.len() && source[at] != b'\n' {
                at += 1;
            }
            continue;
        }
        if !byte.is_ascii_whitespace() {
            hash = (hash ^ byte as u32).wrapping_mul(0x0100_0193);
        }
        at += 1;
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::fold;

    #[test]
    fn comments_and_layout_do_not_count_and_everything_else_does() {
        let hash = |source: &str| fold(0x811c_9dc5, source.as_bytes());
        let plain = hash("struct A { x: u8 }");
        assert_eq!(
            plain,
            hash("/// Words.\nstruct A {\n    x: u8 // more\n}\n")
        );
        assert_ne!(plain, hash("struct A { x: u16 }"));
        assert_ne!(plain, hash("struct A { y: u8 }"));
        // The published value of FNV-1a for "a".
        assert_eq!(hash("a"), 0xe40c_292c);
    }
}
