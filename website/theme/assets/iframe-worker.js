"use strict";

// A browser starts no worker for a page that was opened from a folder; the search runs in a hidden frame instead.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      this.inside = frame.contentWindow;
      this.frame = frame;
      addEventListener("message", event => {
        if (event.source !== this.inside) return;
        this.dispatchEvent(new MessageEvent("message", { data: event.data }));
        this.onmessage?.(event);
      });
      // the search itself asks for further scripts by importScripts, and answers by postMessage
      const prelude = `
        postMessage = data => parent.postMessage(data, "*");
        importScripts = (...addresses) => addresses.reduce((before, one) => before.then(() => new Promise(done => {
          const script = document.createElement("script");
          script.src = one;
          script.onload = done;
          document.body.append(script);
        })), Promise.resolve());`;
      this.inside.document.open();
      this.inside.document.write(`<body><script>${prelude}<\/script><script src="${address}"><\/script></body>`);
      this.inside.document.close();
      this.ready = new Promise(done => { this.inside.onload = done; });  // opening a document forgets what listened
    }
    postMessage(data) {
      this.ready.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data: structuredClone(data) })));
    }
    terminate() {
      this.frame.remove();
    }
  };
}
