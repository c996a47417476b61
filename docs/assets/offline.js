// What the pages need when they are opened as files, and what keyboards need.

// Browsers refuse to start a worker on a page that was opened as a file, and the search is a worker.
// On such a page this runs the worker's script in a hidden frame instead. Messages are copied, as
// between workers: the page keeps what it sent, and would take an object that it shares for unchanged.
if (location.protocol === "file:") {
  window.Worker = class {
    constructor(address) {
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.frame.title = "search";
      document.body.append(this.frame);
      const inside = this.frame.contentWindow;
      inside.postMessage = (data) =>
        setTimeout(() => this.onmessage?.(new MessageEvent("message", { data: structuredClone(data) })));
      const script = inside.document.createElement("script");
      script.src = new URL(address, location.href);
      this.loaded = new Promise((done, failed) => {
        script.onload = done;
        script.onerror = failed;
      });
      this.loaded.catch((event) => this.onerror?.(event));
      inside.document.head.append(script);
    }

    postMessage(data) {
      this.loaded.then(() =>
        this.frame.contentWindow?.onmessage?.(new MessageEvent("message", { data: structuredClone(data) })),
      );
    }

    terminate() {
      this.frame.remove();
    }
  };
}

// Wide tables scroll within their frame; the keyboard must reach that frame, too.
addEventListener("load", () => {
  for (const frame of document.querySelectorAll(".md-typeset__scrollwrap, .md-typeset pre > code"))
    frame.tabIndex = 0;
});
