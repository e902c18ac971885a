//! Colours of drawings for documents: those of the page's style sheet on white.

use plotters::style::RGBColor;

use super::figure::Ink;

pub(super) const TEXT: RGBColor = RGBColor(0x56, 0x5d, 0x69);
pub(super) const GRID: RGBColor = RGBColor(0xe7, 0xe9, 0xed);
pub(super) const FRAME: RGBColor = RGBColor(0x9a, 0xa0, 0xaa);
pub(super) const PAPER: RGBColor = RGBColor(0xff, 0xff, 0xff);

/// The colour of an ink.
pub(super) fn ink(ink: Ink) -> RGBColor {
    match ink {
        Ink::Measured => RGBColor(0x00, 0x9e, 0x73),
        Ink::Estimate => RGBColor(0xc8, 0x28, 0x1e),
        Ink::Second => RGBColor(0x2f, 0x5f, 0xb3),
        Ink::Truth => RGBColor(0x11, 0x14, 0x18),
        Ink::Reference => RGBColor(0x8a, 0x8f, 0x98),
    }
}

/// The colour of a map's value, from -1 over paper at 0 to 1.
pub(super) fn blend(value: f64) -> RGBColor {
    let full = ink(if value < 0.0 {
        Ink::Second
    } else {
        Ink::Estimate
    });
    let share = value.abs().min(1.0);
    let mixed = |full: u8| (255.0 - share * (255.0 - f64::from(full))).round() as u8;
    RGBColor(mixed(full.0), mixed(full.1), mixed(full.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    const INKS: [(Ink, &str); 5] = [
        (Ink::Measured, "measured"),
        (Ink::Estimate, "estimate"),
        (Ink::Second, "second"),
        (Ink::Truth, "truth"),
        (Ink::Reference, "reference"),
    ];

    /// Colours of the style sheet by name, as it stands for a light and for a dark screen.
    fn style_sheet() -> [Vec<(String, RGBColor)>; 2] {
        let css = include_str!("../templates/report.css");
        let [light, dark] = [":root, :root.print {", ":root:not(.print) {"].map(|head| {
            let body = css.split_once(head).unwrap().1.split_once('}').unwrap().0;
            body.split(';')
                .filter_map(|entry| entry.trim().strip_prefix("--")?.split_once(": #"))
                .map(|(name, code)| {
                    let code = u32::from_str_radix(code, 16).unwrap();
                    let [_, red, green, blue] = code.to_be_bytes();
                    (name.to_owned(), RGBColor(red, green, blue))
                })
                .collect()
        });
        [light, dark]
    }

    fn named(colours: &[(String, RGBColor)], name: &str) -> RGBColor {
        colours.iter().find(|colour| colour.0 == name).unwrap().1
    }

    fn linear(colour: RGBColor) -> [f64; 3] {
        [colour.0, colour.1, colour.2].map(|part| {
            let part = f64::from(part) / 255.0;
            if part <= 0.04045 {
                part / 12.92
            } else {
                ((part + 0.055) / 1.055).powf(2.4)
            }
        })
    }

    /// CIE L*a*b* (D65) of a linear colour.
    fn lab([r, g, b]: [f64; 3]) -> [f64; 3] {
        let f = |t: f64| {
            if t > 0.008_856 {
                t.cbrt()
            } else {
                7.787 * t + 16.0 / 116.0
            }
        };
        let x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505);
        let y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
        let z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[test]
    fn a_document_has_the_colours_of_the_page_on_white() {
        let [light, _] = style_sheet();
        for (which, name) in INKS {
            assert_eq!(ink(which), named(&light, name), "{name}");
        }
        for (colour, name) in [
            (TEXT, "muted"),
            (GRID, "grid"),
            (FRAME, "frame"),
            (PAPER, "paper"),
        ] {
            assert_eq!(colour, named(&light, name), "{name}");
        }
    }

    /// Full protanopia and deuteranopia by G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, IEEE Trans.
    /// Visualization and Computer Graphics 15 (2009) 1291-1298, table 1.
    #[test]
    fn inks_differ_for_readers_who_do_not_see_red_or_green() {
        let seen = [
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            [
                [0.152_286, 1.052_583, -0.204_868],
                [0.114_503, 0.786_281, 0.099_216],
                [-0.003_882, -0.048_116, 1.051_998],
            ],
            [
                [0.367_322, 0.860_646, -0.227_968],
                [0.280_085, 0.672_501, 0.047_413],
                [-0.011_820, 0.042_940, 0.968_881],
            ],
        ];
        for sheet in style_sheet() {
            for matrix in seen {
                let colours = INKS.map(|(_, name)| {
                    let colour = linear(named(&sheet, name));
                    let mixed =
                        matrix.map(|row| row.iter().zip(colour).map(|(m, c)| m * c).sum::<f64>());
                    (name, lab(mixed.map(|part| part.clamp(0.0, 1.0))))
                });
                for (index, (name, colour)) in colours.iter().enumerate() {
                    for (other_name, other) in &colours[..index] {
                        let squares = colour.iter().zip(other).map(|(a, b)| (a - b).powi(2));
                        let distance = squares.sum::<f64>().sqrt();
                        // Five times what is just noticeable, 2.3.
                        assert!(distance > 11.5, "{name} and {other_name}: {distance:.1}");
                    }
                }
            }
        }
    }
}
