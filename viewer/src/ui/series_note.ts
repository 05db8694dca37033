// How far the series beyond small strain are: until they are there, deep presses are less exact.

import type { ComputedSeries } from "../net/computed_messages";
import type { Store } from "../store";
import { byId, showText } from "./dom";
import { duration } from "./numbers";

export function followSeries(store: Store): void {
  const note = byId("series-note");
  store.subscribe(["computed"], ({ computed }) => showText(note, seriesText(computed?.series ?? null) || null));
}

export function seriesText(series: ComputedSeries | null): string {
  if (series === null) return "";
  if (series.stopped !== null) return `Large strain: stopped, ${series.stopped}`;
  if (series.places === 0) return "Large strain: preparing";
  const left = series.left_s === null ? "" : `, ${duration(series.left_s)} left`;
  return `Large strain: ${series.done} of ${series.places} places${left}`;
}
