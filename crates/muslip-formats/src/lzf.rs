//! LZF, the packing of h5py's own: runs of bytes as they are, and copies of bytes that came shortly before.

/// The number by which HDF5 knows it.
pub(crate) const FILTER: u16 = 32000;

/// The bytes that were packed; `None` where they are damaged, or more than `most`.
pub(crate) fn unpacked(packed: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut bytes = packed.iter().copied();
    let mut out = Vec::new();
    while let Some(control) = bytes.next() {
        let control = usize::from(control);
        if control < 32 {
            // So many bytes and one as they are.
            for _ in 0..=control {
                out.push(bytes.next()?);
            }
        } else {
            let mut count = control >> 5;
            if count == 7 {
                count += usize::from(bytes.next()?);
            }
            let back = ((control & 31) << 8 | usize::from(bytes.next()?)) + 1;
            let from = out.len().checked_sub(back)?;
            // A copy may reach into what it writes.
            for at in from..from + count + 2 {
                out.push(*out.get(at)?);
            }
        }
        if out.len() > most {
            return None;
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_copies_that_overlap_are_unpacked_and_damage_is_told() {
        // "ab", then six bytes from two back, then a long copy of nine and three from one back.
        let packed = [1, b'a', b'b', 4 << 5, 1, 7 << 5, 3, 0];
        let expected = [b"abababab".as_slice(), &[b'b'; 12]].concat();
        assert_eq!(unpacked(&packed, 100).as_deref(), Some(&expected[..]));
        assert_eq!(unpacked(&packed, 19), None);
        for cut in [1, 2, 4, 6, 7] {
            assert_eq!(unpacked(&packed[..cut], 100), None, "{cut}");
        }
        assert_eq!(unpacked(&[0, b'a', 1 << 5, 1], 100), None);
        assert_eq!(unpacked(&[], 100), Some(Vec::new()));
    }
}
