// Parts of the window that a pointer draws, in pixels.

/** A place of the window, in pixels. */
export type Place = readonly [x: number, y: number];

/** Whether a place is within a distance of the way from one place to another. */
export function withinStroke([fromX, fromY]: Place, [toX, toY]: Place, radius: number): (place: Place) => boolean {
  const [dx, dy] = [toX - fromX, toY - fromY];
  const squared = dx * dx + dy * dy;
  return ([x, y]) => {
    const along = squared === 0 ? 0 : Math.min(Math.max(((x - fromX) * dx + (y - fromY) * dy) / squared, 0), 1);
    return Math.hypot(x - fromX - along * dx, y - fromY - along * dy) <= radius;
  };
}

/** Whether a place is inside a closed line, which may cross itself: inside is what it goes around an odd number of times. */
export function withinLasso(line: readonly Place[]): (place: Place) => boolean {
  return ([x, y]) => {
    let inside = false;
    line.forEach(([ax, ay], i) => {
      const [bx, by] = line[(i + 1) % line.length]!;
      if (ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax)) inside = !inside;
    });
    return inside;
  };
}
