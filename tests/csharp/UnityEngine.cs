// As much of UnityEngine as examples/unity/PalpateBody.cs uses, to compile it where there is no Unity.
using System;

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return new Vector3(); } }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
        public static Vector3 operator /(Vector3 a, float b) { return new Vector3(a.x / b, a.y / b, a.z / b); }
    }
    public struct Quaternion { public float x, y, z, w; }
    public class Component { public T GetComponent<T>() where T : new() { return new T(); } }
    public class MonoBehaviour : Component { }
    public class Transform : Component { public Vector3 position; public Quaternion rotation; }
    public class MeshFilter : Component { public Mesh mesh; }
    public class Mesh
    {
        public Rendering.IndexFormat indexFormat;
        public Vector3[] vertices;
        public int[] triangles;
        public void MarkDynamic() { }
        public void RecalculateNormals() { }
        public void RecalculateBounds() { }
    }
    public static class Time { public static float deltaTime = 0.01f; }
    public static class Application { public static string streamingAssetsPath = "."; }
    public static class Debug { public static void LogWarning(object message) { Console.Error.WriteLine(message); } }
    [AttributeUsage(AttributeTargets.Field)]
    public sealed class TooltipAttribute : Attribute { public TooltipAttribute(string text) { } }
    [AttributeUsage(AttributeTargets.Class)]
    public sealed class RequireComponent : Attribute { public RequireComponent(Type type) { } }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
}
