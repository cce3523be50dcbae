"""Pictures and videos, and when each picture was taken."""
