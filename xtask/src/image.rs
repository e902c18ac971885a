//! What an image's ELF file tells: its sizes, and what must not be in it.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SectionKind};

/// What must not be in an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Forbidden {
    /// Code that panics, and so the handler that it ends in.
    Panic,
    /// Software double precision.
    Double,
    /// A heap.
    Heap,
}

/// Parts of symbols' names that mean it.
const FORBIDDEN: [(Forbidden, &[&str]); 3] = [
    (
        Forbidden::Panic,
        &[
            "4core9panicking",
            "rust_begin_unwind",
            "slice_index_fail",
            "unwrap_failed",
            "expect_failed",
        ],
    ),
    (
        Forbidden::Double,
        &[
            "__aeabi_d",
            "__aeabi_f2d",
            "__aeabi_i2d",
            "__aeabi_ui2d",
            "__aeabi_l2d",
            "__aeabi_ul2d",
            "__aeabi_cd",
            "__adddf3",
            "__subdf3",
            "__muldf3",
            "__divdf3",
            "__extendsfdf2",
            "__truncdfsf2",
            "__floatsidf",
            "__fixdfsi",
        ],
    ),
    (
        Forbidden::Heap,
        &[
            "__rust_alloc",
            "__rust_realloc",
            "__rg_alloc",
            "5alloc5alloc",
        ],
    ),
];

impl Forbidden {
    /// In words.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Panic => "a panic",
            Self::Double => "software double precision",
            Self::Heap => "a heap",
        }
    }
}

/// What an image takes, from its ELF file.
#[derive(Debug)]
pub struct Image {
    /// All that is loaded.
    pub flash_bytes: u64,
    /// `.data` and `.bss`.
    pub ram_bytes: u64,
    /// What memory.x reserves.
    pub stack_bytes: u64,
    /// What must not be there, with its symbol.
    pub forbidden: Vec<(Forbidden, String)>,
}

impl Image {
    /// Reads an image's file.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).with_context(|| path.display().to_string())?;
        Self::parse(&bytes).with_context(|| path.display().to_string())
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let elf = object::File::parse(bytes)?;
        let mut image = Self {
            flash_bytes: 0,
            ram_bytes: 0,
            stack_bytes: 0,
            forbidden: Vec::new(),
        };
        for section in elf.sections() {
            let in_ram = section.address() >= 0x2000_0000;
            match section.kind() {
                SectionKind::Text | SectionKind::ReadOnlyData | SectionKind::ReadOnlyString => {
                    image.flash_bytes += section.size();
                }
                SectionKind::Data if in_ram => {
                    image.flash_bytes += section.size();
                    image.ram_bytes += section.size();
                }
                // The vector table is data that stays in flash.
                SectionKind::Data => image.flash_bytes += section.size(),
                SectionKind::UninitializedData => image.ram_bytes += section.size(),
                _ => {}
            }
        }
        let mut stack = [None; 2];
        let mut sampled = false;
        for symbol in elf.symbols() {
            let name = symbol.name()?;
            match name {
                "_stack_end" => stack[0] = Some(symbol.address()),
                "_stack_start" => stack[1] = Some(symbol.address()),
                "SysTick" => sampled = true,
                _ => {}
            }
            for (what, parts) in FORBIDDEN {
                if parts.iter().any(|part| name.contains(part)) {
                    image.forbidden.push((what, name.to_owned()));
                }
            }
        }
        // Without its symbols an image has nothing that could be found.
        ensure!(
            sampled,
            "no symbol of the sampling interrupt: is it stripped?"
        );
        let [Some(end), Some(start)] = stack else {
            bail!("no symbols of the stack");
        };
        image.stack_bytes = start.checked_sub(end).context("a stack upside down")?;
        Ok(image)
    }

    /// Fails where something is in it that must not be.
    pub fn is_clean(&self) -> Result<()> {
        let found: Vec<String> = self
            .forbidden
            .iter()
            .map(|(what, symbol)| format!("{}: {symbol}", what.meaning()))
            .collect();
        ensure!(
            found.is_empty(),
            "in the image there is {}",
            found.join("; ")
        );
        Ok(())
    }

    /// Whether this is in it.
    pub fn has(&self, what: Forbidden) -> bool {
        self.forbidden.iter().any(|(found, _)| *found == what)
    }
}

#[cfg(test)]
mod tests {
    use super::{FORBIDDEN, Forbidden, Image};
    use object::write::{Object, StandardSection, Symbol, SymbolSection};
    use object::{Architecture, BinaryFormat, Endianness, SymbolFlags, SymbolKind, SymbolScope};

    /// An ELF file with 10 bytes of code, 6 of zeroed data, and these symbols.
    fn elf(names: &[&str]) -> Vec<u8> {
        let mut elf = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
        let text = elf.section_id(StandardSection::Text);
        elf.append_section_data(text, &[0; 10], 1);
        let zeroed = elf.section_id(StandardSection::UninitializedData);
        elf.append_section_bss(zeroed, 6, 1);
        for name in names {
            elf.add_symbol(Symbol {
                name: name.as_bytes().to_vec(),
                value: if *name == "_stack_start" { 8 } else { 0 },
                size: 0,
                kind: SymbolKind::Text,
                scope: SymbolScope::Linkage,
                weak: false,
                section: SymbolSection::Section(text),
                flags: SymbolFlags::None,
            });
        }
        elf.write().unwrap()
    }

    const NEEDED: [&str; 3] = ["SysTick", "_stack_start", "_stack_end"];

    #[test]
    fn sizes_and_stack_are_those_of_the_file_and_a_clean_one_passes() {
        let image = Image::parse(&elf(&NEEDED)).unwrap();
        assert_eq!(
            (image.flash_bytes, image.ram_bytes, image.stack_bytes),
            (10, 6, 8)
        );
        assert!(image.is_clean().is_ok());
    }

    #[test]
    fn every_forbidden_symbol_fails_by_its_meaning_and_its_name() {
        for (what, parts) in FORBIDDEN {
            for part in parts {
                let name = format!("_ZN{part}17h0123456789abcdefE");
                let image = Image::parse(&elf(&[&NEEDED[..], &[&name]].concat())).unwrap();
                for (other, _) in FORBIDDEN {
                    assert_eq!(image.has(other), other == what, "{name}");
                }
                let error = image.is_clean().unwrap_err().to_string();
                assert!(error.contains(what.meaning()) && error.contains(&name));
            }
        }
    }

    #[test]
    fn the_names_that_compiler_and_library_give_are_among_them() {
        for (name, what) in [
            (
                "_ZN4core9panicking9panic_fmt17h3f4dd6b0d9a1e4c1E",
                Forbidden::Panic,
            ),
            (
                "_ZN4core9panicking18panic_bounds_check17h0E",
                Forbidden::Panic,
            ),
            ("_ZN4core6result13unwrap_failed17h0E", Forbidden::Panic),
            (
                "_RNvCsaxZKr0Mvm2Z_7___rustc17rust_begin_unwind",
                Forbidden::Panic,
            ),
            ("__aeabi_dadd", Forbidden::Double),
            ("__aeabi_dcmplt", Forbidden::Double),
            ("__aeabi_cdcmple", Forbidden::Double),
            ("__aeabi_f2d", Forbidden::Double),
            ("__aeabi_ul2d", Forbidden::Double),
            ("__muldf3", Forbidden::Double),
            (
                "_RNvCsaxZKr0Mvm2Z_7___rustc12___rust_alloc",
                Forbidden::Heap,
            ),
        ] {
            let image = Image::parse(&elf(&[&NEEDED[..], &[name]].concat())).unwrap();
            assert!(image.has(what), "{name}");
        }
        // Single precision is in hardware, and its conversions are no fault.
        for name in ["__aeabi_memcpy", "__aeabi_f2iz", "__aeabi_uldivmod"] {
            let image = Image::parse(&elf(&[&NEEDED[..], &[name]].concat())).unwrap();
            assert!(image.is_clean().is_ok(), "{name}");
        }
    }

    #[test]
    fn a_stripped_image_is_no_clean_one() {
        assert!(Image::parse(&elf(&[])).is_err());
        assert!(Image::parse(&elf(&NEEDED[..1])).is_err());
        assert!(Image::parse(b"no ELF").is_err());
    }
}
