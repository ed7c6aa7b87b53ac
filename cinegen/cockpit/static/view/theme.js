// The colours of the scene: those of the page, light or dark as the browser wishes. After Okabe and Ito.

import { Color } from "three";

export const COLOURS = {
  blue: 0x0072b2,
  sky: 0x56b4e9,
  green: 0x009e73,
  orange: 0xe69f00,
  vermilion: 0xd55e00,
  purple: 0xcc79a7,
};

// Two: one that is asked whether it matches, before it tells of a change, tells of none.
const [wish, changes] = [0, 1].map(() => window.matchMedia("(prefers-color-scheme: dark)"));

export const theme = {
  get dark() {
    return wish.matches;
  },
  get accent() {
    return wish.matches ? COLOURS.sky : COLOURS.blue;
  },
  get ink() {
    return wish.matches ? 0xe8ecf0 : 0x1b1f24;
  },
  get ground() {
    return wish.matches ? 0x171c22 : 0xf4f7fa;
  },
  get grid() {
    return wish.matches ? 0x4a5663 : 0xa9b6c3;
  },
  /** Calls `action` now, and whenever the wish changes. @param {() => void} action */
  follow(action) {
    action();
    changes.addEventListener("change", action);
  },
};

/** Gives the scene the page's ground, whatever the server's scene says of its background. @param {View} view */
export function paint(view) {
  const { viewer } = view;
  const ground = new Color();
  const show = () => {
    ground.setHex(theme.ground);
    viewer.scene.background = ground;
    view.changed();
  };
  viewer.scene_tree.find(["Background"]).on_update = show;
  theme.follow(show);
}
