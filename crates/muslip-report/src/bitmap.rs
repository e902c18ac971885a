//! A drawing as a bitmap: the few elements of SVG that `svg` draws with, and its letters. An element that is not
//! among them is an error.

use roxmltree::{Document, Node};
use tiny_skia::{Color, FillRule, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// Pixels for each unit of a figure: 1520 wide, enough for a column of print.
const PIXELS_PER_UNIT: f32 = 2.0;
/// The letters, the same on every machine.
const FONT: &[u8] = include_bytes!("../vendor/dejavu/DejaVuSans.ttf");

/// The bytes of a PNG file.
pub(super) fn png(svg: &str) -> Result<Vec<u8>, String> {
    let document = Document::parse(svg).map_err(|error| error.to_string())?;
    let root = document.root_element();
    let &[_, _, width, height] = numbers(root, "viewBox")?.as_slice() else {
        return Err("a view box has four numbers".into());
    };
    let scale = PIXELS_PER_UNIT * number(root, "width")? / width;
    let mut pixels = Pixmap::new(
        (width * scale).ceil() as u32,
        (height * scale).ceil() as u32,
    )
    .ok_or("no room for the picture")?;
    pixels.fill(Color::WHITE);
    let face = Face::parse(FONT, 0).map_err(|error| error.to_string())?;
    for element in root.children().filter(Node::is_element) {
        draw(element, &face, scale, &mut pixels)?;
    }
    pixels.encode_png().map_err(|error| error.to_string())
}

fn draw(element: Node<'_, '_>, face: &Face<'_>, scale: f32, to: &mut Pixmap) -> Result<(), String> {
    let path = match element.tag_name().name() {
        "line" => {
            let of = |name| number(element, name);
            joined(&[of("x1")?, of("y1")?, of("x2")?, of("y2")?], false)
        }
        "polyline" => joined(&numbers(element, "points")?, false),
        "polygon" => joined(&numbers(element, "points")?, true),
        "rect" => {
            let of = |name| number(element, name);
            Rect::from_xywh(of("x")?, of("y")?, of("width")?, of("height")?)
                .map(PathBuilder::from_rect)
        }
        "circle" => {
            let of = |name| number(element, name);
            PathBuilder::from_circle(of("cx")?, of("cy")?, of("r")?)
        }
        "text" => letters(element, face)?,
        other => return Err(format!("no bitmap of an element <{other}>")),
    };
    // Nothing to see: a line of no length, a word of blanks.
    let Some(path) = path else { return Ok(()) };
    let transform = Transform::from_scale(scale, scale);
    if let Some(paint) = paint(element, "fill")? {
        to.fill_path(&path, &paint, FillRule::Winding, transform, None);
    }
    if let Some(paint) = paint(element, "stroke")? {
        let stroke = Stroke {
            width: if element.has_attribute("stroke-width") {
                number(element, "stroke-width")?
            } else {
                1.0
            },
            ..Stroke::default()
        };
        to.stroke_path(&path, &paint, &stroke, transform, None);
    }
    Ok(())
}

/// The path through points, `x` and `y` in turn.
fn joined(coordinates: &[f32], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (k, point) in coordinates.chunks_exact(2).enumerate() {
        if k == 0 {
            path.move_to(point[0], point[1]);
        } else {
            path.line_to(point[0], point[1]);
        }
    }
    if closed {
        path.close();
    }
    path.finish()
}

/// The outlines of an element's words.
fn letters(element: Node<'_, '_>, face: &Face<'_>) -> Result<Option<Path>, String> {
    let size = number(element, "font-size")?;
    let scale = size / f32::from(face.units_per_em());
    let down = match element.attribute("dy") {
        Some("0.5ex") => 0.25,
        Some("0.76em") => 0.76,
        Some("-0.5ex") => -0.25,
        other => return Err(format!("no bitmap of dy={other:?}")),
    };
    let glyphs: Vec<GlyphId> = element
        .text()
        .unwrap_or_default()
        .trim()
        .chars()
        .map(|letter| face.glyph_index(letter).unwrap_or_default())
        .collect();
    let mut starts = Vec::with_capacity(glyphs.len());
    let mut width = 0.0;
    for (k, &glyph) in glyphs.iter().enumerate() {
        starts.push(width);
        let kerning = glyphs
            .get(k + 1)
            .map_or(0, |&next| kerning(face, glyph, next));
        let advance = face.glyph_hor_advance(glyph).unwrap_or_default();
        width += scale * (f32::from(advance) + f32::from(kerning));
    }
    let before = match element.attribute("text-anchor") {
        Some("start") => 0.0,
        Some("middle") => 0.5 * width,
        Some("end") => width,
        other => return Err(format!("no bitmap of text-anchor={other:?}")),
    };
    let mut outline = Outline {
        path: PathBuilder::new(),
        left: 0.0,
        baseline: number(element, "y")? + down * size,
        scale,
    };
    let left = number(element, "x")? - before;
    for (glyph, start) in glyphs.into_iter().zip(starts) {
        outline.left = left + start;
        face.outline_glyph(glyph, &mut outline);
    }
    Ok(outline.path.finish())
}

/// How much nearer two letters stand than their widths say, in units of the font, negative.
fn kerning(face: &Face<'_>, left: GlyphId, right: GlyphId) -> i16 {
    let tables = face.tables().kern.into_iter();
    tables
        .flat_map(|kern| kern.subtables)
        .filter(|table| table.horizontal && !table.variable)
        .find_map(|table| table.glyphs_kerning(left, right))
        .unwrap_or_default()
}

/// A path that letters are added to: theirs have y upwards.
struct Outline {
    path: PathBuilder,
    left: f32,
    baseline: f32,
    scale: f32,
}

impl Outline {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.left + self.scale * x, self.baseline - self.scale * y)
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// The colour of an attribute with the element's opacity; `None` where it has none.
fn paint(element: Node<'_, '_>, name: &str) -> Result<Option<Paint<'static>>, String> {
    let Some(color) = element.attribute(name).filter(|color| *color != "none") else {
        return Ok(None);
    };
    let rgb = color
        .strip_prefix('#')
        .filter(|digits| digits.len() == 6)
        .and_then(|digits| u32::from_str_radix(digits, 16).ok())
        .ok_or_else(|| format!("no colour: {color}"))?;
    let [_, red, green, blue] = rgb.to_be_bytes();
    let opacity = (255.0 * number(element, "opacity")?).round() as u8;
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, opacity);
    Ok(Some(paint))
}

fn number(element: Node<'_, '_>, name: &str) -> Result<f32, String> {
    match numbers(element, name)?.as_slice() {
        [one] => Ok(*one),
        _ => Err(format!("{name} is not one number")),
    }
}

fn numbers(element: Node<'_, '_>, name: &str) -> Result<Vec<f32>, String> {
    let tag = element.tag_name().name();
    element
        .attribute(name)
        .ok_or_else(|| format!("a <{tag}> without {name}"))?
        .split([' ', ','])
        .filter(|part| !part.is_empty())
        .map(|part| part.parse().map_err(|_| format!("{name}: {part}")))
        .collect()
}

#[cfg(test)]
mod tests {
    use tiny_skia::Pixmap;

    use super::png;

    fn drawn(element: &str) -> Result<Vec<u8>, String> {
        png(&format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"8\" viewBox=\"0 0 8 8\">{element}</svg>"
        ))
    }

    #[test]
    fn a_stroke_of_no_stated_width_is_one_unit_wide() {
        let frame = "<rect x=\"2\" y=\"2\" width=\"4\" height=\"4\" opacity=\"1\" fill=\"none\" \
                     stroke=\"#C8281E\"/>";
        let pixels = Pixmap::decode_png(&drawn(frame).unwrap()).unwrap();
        let inked = |x, y| pixels.pixel(x, y).unwrap().green() == 0x28;
        assert!(inked(3, 8) && inked(4, 8) && !inked(2, 8) && !inked(5, 8));
    }

    #[test]
    fn what_is_not_understood_is_an_error_and_not_left_out() {
        assert!(
            drawn("<ellipse cx=\"1\"/>")
                .unwrap_err()
                .contains("ellipse")
        );
        let line = "<line x1=\"0\" y1=\"0\" x2=\"4\" y2=\"4\" opacity=\"1\" stroke=\"red\"/>";
        assert!(drawn(line).unwrap_err().contains("red"));
    }
}
