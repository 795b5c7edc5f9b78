// Colours of the scene, dark and light. Those of the page around it stand in style.css under the same names.

export const THEMES = {
  light: {
    background: "#f6f7f9",
    ground: "#d5dae1",
    groundLine: "#bcc4ce",
    frame: "#7c858f",
    edge: "#22272e",
    pivot: "#ffffff",
    barrel: "#55606c",
    rod: "#c3cad2",
    spring: "#4a5560",
    reaction: "#b2182b",
    load: "#1b7837",
    driving: "#5e2c91",
    ink: "#1b1f24",
    dim: "#5c6672",
    line: "#dde2e8",
    trace: "#8a94a0",
  },
  dark: {
    background: "#14171c",
    ground: "#272d36",
    groundLine: "#3a424d",
    frame: "#8b949e",
    edge: "#0c0e11",
    pivot: "#e8ebef",
    barrel: "#75818e",
    rod: "#ccd4dc",
    spring: "#c0c8d0",
    reaction: "#ff6b6b",
    load: "#4fd08a",
    driving: "#b58cff",
    ink: "#e8ebef",
    dim: "#97a1ad",
    line: "#2c323b",
    trace: "#7d8793",
  },
};

/** The theme that the reader's system asks for. */
export function preferredTheme() {
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}
