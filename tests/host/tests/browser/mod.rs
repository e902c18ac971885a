//! Debian's chromium without a window, worked over its debugging pipe.
//!
//! The pipe is two file descriptors, 3 in and 4 out, with a NUL after each JSON message: all of the Chrome
//! DevTools Protocol that the tests need is a dozen calls.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Set by `cargo xtask test`, where a missing browser is a failure.
const MUST_RUN: &str = "MUSLIP_PAGES_MUST_RUN";

/// A browser, ended when dropped.
pub struct Browser {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    last_id: u64,
    /// What the page that is open has told since it was opened.
    events: Vec<Value>,
    session: String,
    _profile: TempDir,
}

/// How a page is looked at.
#[derive(Debug, Clone, Copy)]
pub struct View {
    pub width: u32,
    pub dark: bool,
}

/// For a desk.
pub const WIDE: View = View {
    width: 1400,
    dark: false,
};
/// For a hand, at night.
pub const NARROW: View = View {
    width: 400,
    dark: true,
};

impl Browser {
    /// Starts the browser; `None`, saying why, where there is none and there need not be one.
    pub fn start() -> Option<Self> {
        let Some(program) = program() else {
            let why =
                "no chromium on the search path: apt-get install chromium, or cargo xtask test";
            assert!(
                std::env::var_os(MUST_RUN).is_none() && std::env::var_os("CI").is_none(),
                "{why}"
            );
            eprintln!("not run: {why}");
            return None;
        };
        let profile = tempfile::tempdir().unwrap();
        let mut child = Command::new("sh")
            .arg("-c")
            // The pipes to this process become descriptors 3 and 4.
            .arg("exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1")
            .arg(program)
            .args([
                "--headless=new",
                "--remote-debugging-pipe",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
                "--disable-dev-shm-usage",
                "--font-render-hinting=none",
                "--force-color-profile=srgb",
                "--hide-scrollbars",
            ])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = child.stdin.take().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let mut browser = Self {
            child,
            input,
            output,
            last_id: 0,
            events: Vec::new(),
            session: String::new(),
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attached = browser.call(
            "Target.attachToTarget",
            json!({"targetId": target["targetId"], "flatten": true}),
        );
        browser.session = attached["sessionId"].as_str().unwrap().to_owned();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        Some(browser)
    }

    /// Calls a method and waits for its answer; events meanwhile are kept.
    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last_id += 1;
        let mut message = json!({"id": self.last_id, "method": method, "params": parameters});
        if !self.session.is_empty() {
            message["sessionId"] = json!(self.session);
        }
        self.input
            .write_all(message.to_string().as_bytes())
            .unwrap();
        self.input.write_all(&[0]).unwrap();
        self.input.flush().unwrap();
        loop {
            let mut answer = self.next();
            if answer["id"] == self.last_id {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
            self.events.push(answer);
        }
    }

    fn next(&mut self) -> Value {
        let mut bytes = Vec::new();
        self.output.read_until(0, &mut bytes).unwrap();
        assert_eq!(bytes.pop(), Some(0), "the browser has ended");
        serde_json::from_slice(&bytes).unwrap()
    }

    /// Opens a file and waits until it is loaded.
    pub fn open(&mut self, file: &Path, view: View) {
        let View { width, dark } = view;
        self.call(
            "Emulation.setDeviceMetricsOverride",
            json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false}),
        );
        let scheme = if dark { "dark" } else { "light" };
        self.call(
            "Emulation.setEmulatedMedia",
            json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]}),
        );
        self.events.clear();
        let url = format!("file://{}", file.display());
        self.call("Page.navigate", json!({"url": url}));
        while !self
            .events
            .iter()
            .any(|event| event["method"] == "Page.loadEventFired")
        {
            let event = self.next();
            self.events.push(event);
        }
        // The first frame, and what was put off until it.
        self.evaluate(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))",
        );
    }

    /// The value of an expression in the page; a promise's where it is one.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let mut outcome = self.call(
            "Runtime.evaluate",
            json!({"expression": expression, "awaitPromise": true, "returnByValue": true}),
        );
        assert!(
            outcome["exceptionDetails"].is_null(),
            "{expression}: {}",
            outcome["exceptionDetails"]
        );
        outcome["result"]["value"].take()
    }

    /// A number in the page.
    pub fn number(&mut self, expression: &str) -> f64 {
        let value = self.evaluate(expression);
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{expression} is {value}"))
    }

    /// A text in the page.
    pub fn text(&mut self, expression: &str) -> String {
        let value = self.evaluate(expression);
        value
            .as_str()
            .unwrap_or_else(|| panic!("{expression} is {value}"))
            .to_owned()
    }

    /// Presses a key after an expression, such as one that moves the focus.
    pub fn press(&mut self, key: &str, after: &str) {
        self.evaluate(after);
        for kind in ["keyDown", "keyUp"] {
            let code = match key {
                "End" => 35,
                "Home" => 36,
                _ => 13,
            };
            self.call(
                "Input.dispatchKeyEvent",
                json!({"type": kind, "key": key, "code": key, "windowsVirtualKeyCode": code}),
            );
        }
    }

    /// A picture (PNG) of the page's upper part, reduced; the whole page where no height is given.
    pub fn picture(&mut self, height: Option<f64>, scale: f64) -> Vec<u8> {
        use base64::Engine as _;
        let size = self.call("Page.getLayoutMetrics", json!({}))["cssContentSize"].take();
        let height = height.unwrap_or_else(|| size["height"].as_f64().unwrap());
        let clip =
            json!({"x": 0, "y": 0, "width": size["width"], "height": height, "scale": scale});
        let shot = self.call(
            "Page.captureScreenshot",
            json!({"format": "png", "captureBeyondViewport": true, "clip": clip}),
        );
        base64::engine::general_purpose::STANDARD
            .decode(shot["data"].as_str().unwrap())
            .unwrap()
    }

    /// What the page complained about, and what it asked the network for, since it was opened.
    pub fn problems(&mut self) -> Vec<String> {
        // An answer comes after the events before it.
        self.evaluate("0");
        let mut problems = Vec::new();
        let mut requests = 0;
        for event in &self.events {
            let told = &event["params"];
            match event["method"].as_str().unwrap_or_default() {
                "Runtime.consoleAPICalled" if told["type"] == "error" => {
                    problems.push(format!("console: {}", told["args"]));
                }
                "Runtime.exceptionThrown" => {
                    problems.push(format!("exception: {}", told["exceptionDetails"]));
                }
                "Log.entryAdded" if told["entry"]["level"] != "info" => {
                    problems.push(format!("log: {}", told["entry"]));
                }
                "Network.requestWillBeSent" => {
                    requests += 1;
                    // The file itself is the first.
                    if requests > 1 {
                        problems.push(format!("request: {}", told["request"]["url"]));
                    }
                }
                _ => {}
            }
        }
        problems
    }

    /// Faults of accessibility that axe-core calls serious or critical.
    pub fn accessibility_faults(&mut self) -> Vec<String> {
        let axe = include_str!("../../vendor/axe-core/axe.min.js");
        // Tools are not bound by the page's policy.
        self.evaluate(&format!("{axe};0"));
        let found = self.evaluate(
            "axe.run(document, {resultTypes: ['violations']}).then((result) => result.violations \
             .filter(({impact}) => impact === 'serious' || impact === 'critical') \
             .map(({id, help, nodes}) => `${id}: ${help}: ` + nodes.slice(0, 5).map((node) => node.html).join(' ')))",
        );
        let faults = found.as_array().unwrap().iter();
        faults
            .map(|fault| fault.as_str().unwrap().to_owned())
            .collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn program() -> Option<std::path::PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .flat_map(|folder| ["chromium", "google-chrome"].map(|name| folder.join(name)))
        .find(|program| program.is_file())
}
