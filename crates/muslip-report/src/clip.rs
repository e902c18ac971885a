//! Lines cut at the frame of a figure.

use super::figure::Figure;

/// The pieces of a line that lie within the frame, as positions.
pub(super) fn pieces_inside(
    figure: &Figure,
    points: &[(f64, f64)],
    along: (f64, f64),
    up: (f64, f64),
) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut before = None;
    for point in points {
        let now = figure.x.position(point.0).zip(figure.y.position(point.1));
        if let (Some(from), Some(to)) = (before, now)
            && let Some((start, end)) = clipped(from, to, along, up)
        {
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&start) => piece.push(end),
                _ => pieces.push(vec![start, end]),
            }
        }
        before = now;
    }
    pieces
}

type Point = (f64, f64);

/// The part of a straight line within a frame (Y.-D. Liang and B. A. Barsky, ACM Trans. Graphics 3
/// (1984) 1-22).
fn clipped(from: Point, to: Point, along: Point, up: Point) -> Option<(Point, Point)> {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (slope, room) in [
        (-dx, from.0 - along.0),
        (dx, along.1 - from.0),
        (-dy, from.1 - up.0),
        (dy, up.1 - from.1),
    ] {
        if slope == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if slope < 0.0 {
            enter = enter.max(room / slope);
        } else {
            leave = leave.min(room / slope);
        }
    }
    let at = |share: f64| match share {
        0.0 => from,
        1.0 => to,
        _ => (from.0 + share * dx, from.1 + share * dy),
    };
    (enter <= leave).then(|| (at(enter), at(leave)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_at_the_frame() {
        let cut = |from, to| clipped(from, to, (0.0, 1.0), (0.0, 1.0));
        assert_eq!(cut((-1.0, 0.5), (2.0, 0.5)), Some(((0.0, 0.5), (1.0, 0.5))));
        assert_eq!(cut((0.2, 0.2), (0.4, 0.4)), Some(((0.2, 0.2), (0.4, 0.4))));
        assert_eq!(cut((0.5, 0.5), (0.5, 2.5)), Some(((0.5, 0.5), (0.5, 1.0))));
        assert_eq!(cut((-1.0, 0.5), (0.5, 2.0)), None);
        assert_eq!(cut((2.0, 0.0), (2.0, 1.0)), None);
    }
}
