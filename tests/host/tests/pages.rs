//! The pages as a person meets them, in a browser: drawn, moved, asked, read aloud.
//!
//! A machine without chromium leaves these out and says so; `cargo xtask test` installs it.

use crate::browser::{Browser, NARROW, View, WIDE};
use crate::common::{RIG, Scratch, recording_of};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use test_support::scenario::article;

/// A folder with a rig file and the article's stream as a recording.
fn scratch() -> Scratch {
    let scratch = Scratch::with_rig(&format!("{RIG}\n[noise]\ndrag_force_n = 40.0\n"));
    scratch.write("run.csv", recording_of(article::measurements(1)));
    scratch
}

/// The same with the page of an estimate by one of the filters, and its trace.
fn estimated(estimator: &str) -> Scratch {
    let scratch = scratch();
    scratch.output(&[
        "estimate",
        "--rig",
        "rig.toml",
        "--estimator",
        estimator,
        "--report",
        "page.html",
        "--trace",
        "trace.json",
        "run.csv",
    ]);
    scratch
}

/// Opens a page and finds no fault with it.
fn check(browser: &mut Browser, scratch: &Scratch, page: &str, view: View) {
    let about = format!("{page} at {view:?}");
    browser.open(&scratch.path(page), view);
    assert_eq!(browser.problems(), [""; 0], "{about}");
    assert_eq!(browser.accessibility_faults(), [""; 0], "{about}");
    let wide = browser.number("document.documentElement.scrollWidth");
    assert!(wide <= f64::from(view.width), "{about} is {wide} wide");
    let empty = browser.evaluate(
        "[...muslip.figures.values()].filter(({plot}) => { \
           const { left, top, width, height } = plot.bbox; \
           const dots = plot.ctx.getImageData(left, top, width, height).data; \
           return new Set(new Uint32Array(dots.buffer)).size < 4; \
         }).map(({spec}) => spec.id)",
    );
    assert_eq!(empty, serde_json::json!([]), "{about}: nothing is drawn");
    if let Some(folder) = std::env::var_os("MUSLIP_PICTURES") {
        let name = format!("{}-{}.png", page.replace('/', "-"), view.width);
        let picture = browser.picture(None, 1.0);
        std::fs::write(std::path::Path::new(&folder).join(name), picture).unwrap();
    }
}

#[test]
fn pages_of_the_demo_are_drawn_without_network_or_fault() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = Scratch::new();
    scratch.output(&["demo"]);
    for view in [WIDE, NARROW] {
        for page in ["muslip-demo/report.html", "muslip-demo/found/report.html"] {
            check(&mut browser, &scratch, page, view);
        }
    }
}

fn convergence_page(options: study_article::PaperOptions) -> String {
    let page = study_article::convergence_page(options).unwrap();
    page.to_html().unwrap()
}

#[test]
fn pages_of_the_article_and_the_quarter_car_are_drawn_without_network_or_fault() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = Scratch::new();
    let options = study_article::PaperOptions {
        seed: 1,
        streams: 20,
    };
    let article = study_article::report_page(&study_article::reproduce(options, &mut |_| {}));
    scratch.write("article.html", article.unwrap().to_html().unwrap());
    scratch.write("convergence.html", convergence_page(options));
    let options = study_quarter_car::StudyOptions {
        stops: 1,
        draws: 1,
        ..Default::default()
    };
    let car = study_quarter_car::study(options, &mut |_| {}).unwrap();
    let car = study_quarter_car::report_page(&car).unwrap();
    scratch.write("car.html", car.to_html().unwrap());
    for view in [WIDE, NARROW] {
        for page in ["article.html", "convergence.html", "car.html"] {
            check(&mut browser, &scratch, page, view);
        }
    }
}

#[test]
fn the_campaign_s_page_sorts_marks_and_links() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = scratch();
    let mut arguments = vec!["campaign", "--rig", "rig.toml", "--out", "all"];
    let names: Vec<String> = (0..7).map(|seed| format!("run{seed}.csv")).collect();
    for (name, seed) in names.iter().zip(0..) {
        // The fourth is of a road that is half as slippery again.
        let grip = if seed == 3 { 1.5 } else { 1.0 };
        let points = article::measurements(seed);
        let points = points
            .into_iter()
            .map(|(slip, friction)| (slip, grip * friction));
        scratch.write(name, recording_of(points));
        arguments.push(name);
    }
    let told = scratch.output(&arguments);
    assert!(
        told.contains("One stands out") && told.contains("run3.csv"),
        "{told}"
    );
    for view in [WIDE, NARROW] {
        check(&mut browser, &scratch, "all/index.html", view);
    }
    let column = |index: usize| {
        format!(
            "[...document.querySelectorAll('table.sortable tbody tr')].map((row) => row.cells[{index}].textContent)"
        )
    };
    let marked = browser.evaluate(
        "[...document.querySelectorAll('tr.marked')].map((row) => row.cells[1].textContent)",
    );
    assert_eq!(marked, serde_json::json!(["run3.csv"]));
    let press = |index: usize| {
        format!("document.querySelectorAll('table.sortable th button')[{index}].click()")
    };
    browser.evaluate(&press(2));
    let peaks: Vec<f64> = browser
        .evaluate(&column(2))
        .as_array()
        .unwrap()
        .iter()
        .map(|text| text.as_str().unwrap().parse().unwrap())
        .collect();
    assert!(peaks.is_sorted() && peaks.len() == 7, "{peaks:?}");
    browser.evaluate(&press(2));
    assert_eq!(browser.evaluate(&column(1))[0], "run3.csv");
    let target = browser.text("document.querySelector('tr.marked a').getAttribute('href')");
    assert!(
        scratch
            .read(&format!("all/{target}"))
            .contains("player-curve")
    );
}

/// What a summary of so many recordings says, made up: of the size and the spread of a test department's.
fn fleet_of(recordings: u32) -> muslip_report::fleet::Fleet {
    use rand_distr::Distribution;
    let mut noise =
        <rand_chacha::ChaCha8Rng as rand_chacha::rand_core::SeedableRng>::seed_from_u64(1);
    let mut drawn = |mean: f64, scatter: f64| -> Vec<f64> {
        let normal = rand_distr::Normal::new(mean, scatter).unwrap();
        (0..recordings).map(|_| normal.sample(&mut noise)).collect()
    };
    let points = json!({"peak_friction": drawn(0.85, 0.03), "critical_slip": drawn(0.14, 0.01)});
    let at = |value: f64| json!({"value": value, "std": 0.001});
    let levels = (0..40).map(|rig| {
        json!({"name": format!("rig-{rig}"), "recordings": 2_500, "mean": at(0.83 + 0.001 * f64::from(rig)), "scatter": 0.02})
    });
    let levels: Vec<Value> = levels.collect();
    let days =
        (0..60).map(|day| json!([format!("day {day}"), 0.85 + 0.0005 * f64::from(day), 0.003]));
    let days: Vec<Value> = days.collect();
    let outliers = (0..500).map(|run| {
        json!({"path": format!("runs/{run:06}.mf4"), "quantity": "peak_friction", "value": at(1.2), "median": 0.85, "sigmas": 11.0})
    });
    let outliers: Vec<Value> = outliers.collect();
    let fleet = json!({
        "recordings": recordings + 7, "estimated": recordings, "errors": {"cannot be read": 7},
        "peak_friction": at(0.85), "critical_slip": at(0.14),
        "factors": [{"name": "rig", "quantity": "peak_friction", "levels": levels, "mean": at(0.85), "between": 0.01, "crossed": 0.008}],
        "drifts": [{"rig": "rig-7", "per_day": {"value": 0.0005, "std": 1e-5}, "p": 1e-9, "days": 60, "drifts": true, "course": days}],
        "outliers": outliers,
        "mechanisms": [{"mechanism": "force_delay", "named": 250, "diagnoses": 1000, "low": 0.22, "high": 0.28, "confidence": 0.9}],
        "points": points,
    });
    serde_json::from_value(fleet).unwrap()
}

#[test]
fn a_fleet_s_page_has_no_more_elements_for_a_hundred_thousand_recordings() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = Scratch::new();
    let mut elements = Vec::new();
    for (recordings, page) in [(1_000, "few.html"), (100_000, "many.html")] {
        let fleet = fleet_of(recordings).page("results", "python -m muslip.fleet summary results");
        scratch.write(page, fleet.to_html().unwrap());
        for view in [WIDE, NARROW] {
            let start = Instant::now();
            check(&mut browser, &scratch, page, view);
            let took = start.elapsed();
            println!("{page} at {}: looked at in {took:.1?}", view.width);
            // Ten times what it takes on a quiet machine; a page that lags takes minutes.
            assert!(took < Duration::from_secs(60), "{page} took {took:.1?}");
        }
        elements.push(browser.number("document.querySelectorAll('*').length"));
        let drawn = browser.number("document.querySelectorAll('canvas').length");
        assert!(drawn >= 4.0, "{drawn} figures");
    }
    assert_eq!(elements[0], elements[1]);
}

#[test]
fn hostile_text_is_shown_as_text() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = scratch();
    let name = "<script>alert(1)<script><img src=x onerror=alert(2)>.csv";
    scratch.write(name, scratch.read("run.csv"));
    scratch.output(&["estimate", "--rig", "rig.toml", "--report", "r.html", name]);
    browser.open(&scratch.path("r.html"), WIDE);
    assert_eq!(browser.problems(), [""; 0]);
    assert!(
        browser
            .text("document.querySelector('.subject').textContent")
            .contains(name)
    );
    assert_eq!(browser.number("document.images.length"), 0.0);
}

#[test]
fn the_animation_plays_pauses_steps_and_follows_slider_and_keys() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = estimated("article");
    browser.open(&scratch.path("page.html"), WIDE);
    let last = browser.number("muslip.player.last");
    assert_eq!(last, 41.0);
    let measured = "muslip.figures.get('player-curve').spec.layers.find((l) => l.live === 'measured').x.length";
    assert_eq!(browser.number("muslip.player.shown"), last);
    assert_eq!(browser.number(measured), 41.0);

    // From the end it starts anew, goes on by itself and stops where it is told to.
    browser.evaluate("document.querySelector('.speed').value = '8'");
    let started =
        "(() => { document.querySelector('.play').click(); return muslip.player.shown; })()";
    assert_eq!(browser.number(started), 0.0);
    browser.evaluate(
        "new Promise((done) => { const wait = () => (muslip.player.shown > 4 ? done() : setTimeout(wait, 10)); wait(); })",
    );
    browser.evaluate("document.querySelector('.play').click()");
    let paused = browser.number("muslip.player.shown");
    assert!((5.0..41.0).contains(&paused), "{paused}");
    browser.evaluate("new Promise((done) => setTimeout(done, 200))");
    assert_eq!(browser.number("muslip.player.shown"), paused);
    assert_eq!(browser.number(measured), paused);

    browser.evaluate("document.querySelector('.step').click()");
    assert_eq!(browser.number("muslip.player.shown"), paused + 1.0);
    browser.evaluate("document.querySelector('.back').click()");
    assert_eq!(browser.number("muslip.player.shown"), paused);
    let area = "(() => { const l = muslip.figures.get('player-curve').spec.layers.find((l) => l.live === 'ellipse'); \
                return Math.max(...l.x) - Math.min(...l.x); })()";
    browser.evaluate(
        "(() => { const slider = document.querySelector('.position'); slider.value = 0; \
           slider.dispatchEvent(new Event('input')); })()",
    );
    let wide = browser.number(area);
    assert!((wide - 0.4).abs() < 0.01, "{wide}");
    assert!(
        browser
            .text("document.querySelector('.position').getAttribute('aria-valuetext')")
            .starts_with("Before the first measurement")
    );
    browser.press("End", "document.querySelector('.position').focus()");
    assert_eq!(browser.number("muslip.player.shown"), last);
    assert!(browser.number(area) < 0.2 * wide);
    assert_eq!(browser.problems(), [""; 0]);
}

#[test]
fn the_filter_in_the_page_gives_the_command_s_numbers_bit_for_bit() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    for estimator in ["article", "efficient"] {
        let scratch = estimated(estimator);
        let trace: Value = serde_json::from_str(&scratch.read("trace.json")).unwrap();
        browser.open(&scratch.path("page.html"), WIDE);
        let run = browser.evaluate(
            "muslip.whatIf.core.then((core) => muslip.whatIf.run(core, muslip.whatIf.asItWas()).frames)",
        );
        let rows = trace.as_array().unwrap();
        assert_eq!(rows.len(), 41);
        for (index, row) in rows.iter().enumerate() {
            for (column, name) in [
                ("peak", "peak_friction"),
                ("criticalSlip", "critical_slip"),
                ("innovation", "innovation"),
                ("nis", "nis"),
                ("noise", "noise_variance"),
                ("before", "signal_before"),
                ("after", "signal_after"),
            ] {
                // The first frame is the start.
                let page = &run[column][index + 1];
                assert_eq!(
                    page.as_f64(),
                    row[name].as_f64(),
                    "{estimator} {name} {index}"
                );
            }
            let variance = run["peakStd"][index + 1].as_f64().unwrap().powi(2);
            let told = row["p11"].as_f64().unwrap();
            assert!((variance - told).abs() <= 1e-12 * told);
        }
        assert_eq!(browser.problems(), [""; 0]);
    }
}

#[test]
fn other_assumptions_change_the_estimate_and_the_way_back_restores_it() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = estimated("article");
    browser.open(&scratch.path("page.html"), WIDE);
    let peak = "muslip.whatIf.result.frames.peak.at(-1)";
    let set = |name: &str, change: &str| {
        format!(
            "(() => {{ const field = document.querySelector('[name=\"{name}\"]'); field.{change}; \
               field.dispatchEvent(new Event('input', {{ bubbles: true }})); \
               return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); }})()"
        )
    };
    browser.evaluate(&set("noise", "value = 0"));
    let usual = browser.number(peak);
    for (name, change) in [
        ("noise", "value = 1"),
        ("peak", "value = 1.2"),
        ("slip", "value = 0.1"),
        ("spread", "value = 0.2"),
        ("pseudonoise", "checked = false"),
        ("estimator", "value = '1'"),
    ] {
        browser.evaluate(&set(name, change));
        let changed = browser.number(peak);
        assert!((changed - usual).abs() > 1e-6, "{name}: {changed}");
        // What is shown is what was computed.
        let shown = browser.number("muslip.player.run.frames.peak.at(-1)");
        assert_eq!(shown, changed);
        browser.evaluate("document.querySelector('[name=\"reset\"]').click()");
        browser.evaluate(&set("noise", "value = 0"));
        assert_eq!(browser.number(peak), usual, "{name}");
    }
    let told = browser.text("document.getElementById('what-if-result').textContent");
    assert!(told.starts_with("As in the command's run"), "{told}");
    assert_eq!(browser.problems(), [""; 0]);
}

#[test]
fn layers_that_the_page_computes_are_those_that_the_command_wrote() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = estimated("article");
    browser.open(&scratch.path("page.html"), WIDE);
    let worst = browser.evaluate(
        "muslip.data('figures').flatMap(({ layers }) => layers.filter(({ live }) => live).map((written) => { \
           const computed = muslip.live[written.live](muslip.convergence.host, muslip.player.last); \
           const differences = ['x', 'y', 'low', 'high'].filter((key) => key in written && written.shape !== 'level' || key === 'y' && written.y) \
             .flatMap((key) => Array.from(written[key], (value, i) => Math.abs((value ?? 0) - (computed[key][i] ?? 0)))); \
           return [written.live, Math.max(...differences), differences.length]; }))",
    );
    let layers = worst.as_array().unwrap();
    // Ellipse and peak are in two figures.
    assert_eq!(layers.len(), 22, "{worst}");
    for layer in layers {
        let difference = layer[1].as_f64().unwrap();
        assert!(
            difference < 2e-4 && layer[2].as_f64().unwrap() > 0.0,
            "{layer}"
        );
    }
}

#[test]
fn a_page_looks_as_it_did() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let scratch = Scratch::new();
    let options = study_article::PaperOptions {
        seed: 1,
        streams: 2,
    };
    scratch.write("convergence.html", convergence_page(options));
    for (view, name) in [
        (WIDE, "convergence-wide"),
        (NARROW, "convergence-narrow-dark"),
    ] {
        browser.open(&scratch.path("convergence.html"), view);
        let picture = browser.picture(Some(1100.0), 0.25);
        let path = format!("{}/tests/pictures/{name}.png", env!("CARGO_MANIFEST_DIR"));
        if std::env::var_os("MUSLIP_BLESS").is_some() {
            std::fs::write(&path, &picture).unwrap();
            if view.width == WIDE.width {
                // The README's: the same page on the way.
                browser.evaluate("muslip.player.show(muslip.player.run, 16)");
                let shown = browser.picture(Some(790.0), 0.75);
                let readme = format!("{}/../../docs/convergence.png", env!("CARGO_MANIFEST_DIR"));
                std::fs::write(readme, shown).unwrap();
            }
        }
        let [now, then] = [picture, std::fs::read(&path).unwrap()].map(|png| pixels(&png));
        assert_eq!(now.0, then.0, "{name}: another size");
        // Letters of another font or version may differ; a plot that moved or a colour that changed may not.
        let differences = now.1.iter().zip(&then.1).map(|(a, b)| a.abs_diff(*b));
        let mean = differences.clone().map(f64::from).sum::<f64>() / now.1.len() as f64;
        let far = differences.filter(|difference| *difference > 64).count();
        let share = far as f64 / now.1.len() as f64;
        assert!(
            mean < 4.0 && share < 0.02,
            "{name}: mean {mean:.2}, {share:.4} far off"
        );
    }
}

/// Size and bytes of a PNG.
fn pixels(png: &[u8]) -> ((u32, u32), Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png))
        .read_info()
        .unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    bytes.truncate(info.buffer_size());
    ((info.width, info.height), bytes)
}
