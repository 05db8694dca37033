// Shows the page of `palpate web` in an iframe. All of its files come from Python, so that no server has to have them: they get
// addresses of their own in this browser.

const SCRIPT = "__palpate_script__";
const FILES = "__palpate_files__";

export default {
  render({ model, el }) {
    const urls = [];
    const address = (content, type) => {
      urls.push(URL.createObjectURL(new Blob([content], { type })));
      return urls.at(-1);
    };
    const files = {
      program: address(model.get("program"), "application/wasm"),
      worker: address(model.get("worker"), "text/javascript"),
      scene: address(model.get("scene"), "application/octet-stream"),
    };
    const page = model
      .get("page")
      .replace(SCRIPT, address(model.get("script"), "text/javascript"))
      .replace(FILES, JSON.stringify(files).replaceAll('"', "&quot;"));
    const frame = document.createElement("iframe");
    frame.title = "Palpate";
    frame.src = address(page, "text/html;charset=utf-8");
    frame.style.cssText = "display: block; width: 100%; border: 0; border-radius: 6px";
    const resize = () => (frame.style.height = `${model.get("height")}px`);
    model.on("change:height", resize);
    resize();
    el.append(frame);
    return () => {
      model.off("change:height", resize);
      urls.forEach((url) => URL.revokeObjectURL(url));
    };
  },
};
